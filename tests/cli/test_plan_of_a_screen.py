"""What a monitor cannot show of a study is said at plan."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from visavis.cli.main import app  # type: ignore[attr-defined]
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE

STUDY = """
from visavis import Factor, Grating, Study, Text

study = Study("fits", "S", factors=[Factor("word", ["ä ≤", "WORD"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show([Grating(6, CYCLES), Text("word " * COUNT, at_deg=(AT, 0)), Text(t.word)], 1)
"""
ASKS = """
from visavis import Choice, Factor, Keys, Rating, Study, Text

study = Study("asks", "S", factors=[Factor("word", ["a", "b"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text("a"), 1)
    yield t.ask(QUESTION)
"""
TABLE = """
from visavis import Factor, Items, Study, Text

study = Study("table", "S", factors=[Factor("word", ["a", "b", "c"])], items=Items("things.csv"),
              repetitions=REPETITIONS, calibrate=False)

@study.trial
def trial(t):
    yield t.show(Text(t.item), 1)
"""
STAIRS = """
from visavis import Factor, Keys, Staircase, Study, Text

GREY = Staircase("grey", start=0.3, step=0.1)
study = Study("stairs", "S", factors=[Factor("word", ["a", "b"])], calibrate=False)

@study.trial
def trial(t):
    stairs = t.staircase(GREY)
    answer = yield t.show(Text(t.word), until=Keys("f", "j", right="f"))
    TAKE
"""


def plan_output(
    folder: Path, lab: Path, cycles: float, count: int, right_deg: float, word: str = "b"
) -> str:
    text = STUDY.replace("CYCLES", str(cycles)).replace("COUNT", str(count)).replace("WORD", word)
    (folder / "fits.py").write_text(text.replace("AT", str(right_deg)), "utf-8")
    (folder / "lab_config.yaml").write_text(lab.read_text("utf-8"), "utf-8")
    words = ["plan", str(folder / "fits.py"), "--config", str(folder / "lab_config.yaml")]
    return " ".join(CliRunner().invoke(app, words).output.split())


@pytest.mark.parametrize(
    ("cycles", "count", "right_deg", "says"),
    [
        (20.6, 1, 0, "gratings of 20.6 cycles a degree are finer than the pixels"),
        (2, 60, 0, "Text 'word word word word word word word word ' is"),
        (2, 1, 24, "pixels large and reaches beyond the screen of 1920 × 1080"),
    ],
)
def test_what_a_screen_cannot_show_is_said(
    tmp_path: Path, cycles: float, count: int, right_deg: float, says: str
) -> None:
    assert says in plan_output(tmp_path, SCREEN_EXAMPLE, cycles, count, right_deg)


def test_nothing_is_said_of_what_fits_or_where_there_is_no_screen(tmp_path: Path) -> None:
    both = "reaches beyond", "finer than"
    fits = plan_output(tmp_path, SCREEN_EXAMPLE, 20.4, 1, 15)
    headset = plan_output(tmp_path, EXAMPLE, 43, 60, 15)
    assert [] == [words for words in both for said in (fits, headset) if words in said]
    assert "2 trials in 1 block" in fits
    assert "2 trials in 1 block" in headset


@pytest.mark.parametrize("lab", [EXAMPLE, SCREEN_EXAMPLE])
def test_letters_that_no_font_has_are_said(tmp_path: Path, lab: Path) -> None:
    assert "no font of Visavis has 日 本, " in plan_output(tmp_path, lab, 2, 1, 0, "日本 日")
    assert "no font" not in plan_output(tmp_path, lab, 2, 1, 0)


def output_of(folder: Path, text: str) -> str:
    """Return what is said at plan of a study before a screen."""
    (folder / "own.py").write_text(text, "utf-8")
    (folder / "lab_config.yaml").write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    words = ["plan", str(folder / "own.py"), "--config", str(folder / "lab_config.yaml")]
    return " ".join(CliRunner().invoke(app, words).output.split())


@pytest.mark.parametrize("question", ['Rating("nice", 1, 7)', 'Choice("which", ["a", "本 b"])'])
def test_letters_of_boards_that_no_font_has_are_said(tmp_path: Path, question: str) -> None:
    output = output_of(tmp_path, ASKS.replace("QUESTION", question))
    assert ("本" in question) is ("no font of Visavis has 本, which boards show as boxes" in output)


def test_a_table_with_more_rows_than_trials_is_said(tmp_path: Path) -> None:
    (tmp_path / "things.csv").write_text("item\n" + "\n".join(f"t{k}" for k in range(9)), "utf-8")
    says = "things.csv has 9 rows, of which this person sees 6: there are no trials for the other 3"
    assert [
        says in output_of(tmp_path, TABLE.replace("REPETITIONS", str(count))) for count in (2, 3)
    ] == [True, False]


@pytest.mark.parametrize("hears", [True, False])
def test_a_staircase_that_hears_of_no_answer_is_said(tmp_path: Path, hears: bool) -> None:
    take = "stairs.take(answer.is_right)" if hears else "pass"
    output = output_of(tmp_path, STAIRS.replace("TAKE", take))
    assert hears is not ("no trial lets the staircase grey hear of an answer" in output)

"""A mistake in a user's file is told as theirs: file, line, function, and what it got."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG
from visavis import Choice, Keys
from visavis.cli.main import app
from visavis.lab.errors import DataError, DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.study_folder import holds_trial
from visavis.running.study_check import languages_of
from visavis.study.measures import TrialRecord, value_of
from visavis.study.study_errors import users_mistake
from visavis.testing import check_study

STUDY = """from visavis import Factor, Measure, Rating, Scene, Study

study = Study("meet", factors=[Factor("motion", ["idle", "wave"])], calibrate=False, uses=[],
    measures=[Measure("half", "1", "Half", lambda record: half_of(record.row))])


@study.scene("mine")
def mine(staging, *, motion):
    raise RuntimeError("no such thing")


def half_of(row):
    return row["nice"] / 2


@study.trial
def trial(t):
    yield t.show(Scene("person", motion=t.motion), seconds=0.2)
    yield t.ask(Rating("nice", 1, 7))


@study.answer
def answer(seen, response, rng):
    return "4"
"""


def written(folder: Path, old: str = "", new: str = "") -> Path:
    assert old in STUDY
    path = folder / "meet.py"
    path.write_text(STUDY.replace(old, new) if old else STUDY, "utf-8")
    return path


def test_mistake_in_an_answer_is_told_with_what_it_was_called_with(tmp_path: Path) -> None:
    path = written(tmp_path, 'return "4"', "return str(4 / 0)")
    with pytest.raises(DesignError) as caught:
        check_study(path)
    said = str(caught.value)
    assert f"{path}, line 24 in answer(seen=Seen(" in said
    assert "response=Rating(name='nice', low=1, high=7), rng=Generator" in said
    assert "ZeroDivisionError: division by zero; correct it there" in said


def test_answer_that_is_no_option_is_the_study_files(tmp_path: Path) -> None:
    path = written(tmp_path, 'return "4"', 'return "9"')
    with pytest.raises(DesignError, match=r"answer.*nice|nice.*answer"):
        check_study(path)


def test_mistake_in_a_scene_of_the_study_is_told_with_its_line(tmp_path: Path) -> None:
    path = written(tmp_path, 'Scene("person"', 'Scene("mine"')
    study = find_study(str(path))
    with pytest.raises(RuntimeError) as caught:
        study.experiment({})
    mistake = users_mistake(caught.value)
    assert mistake is not None
    assert f"{path}, line 9 in mine(" in str(mistake)
    assert "motion='idle'): RuntimeError: no such thing" in str(mistake)


def test_mistake_in_a_measure_names_its_line_and_row(tmp_path: Path) -> None:
    path = written(tmp_path, 'row["nice"] / 2', 'row["nicer"] + 1')
    (measure,) = find_study(str(path)).study.analysis.measures
    with pytest.raises(DataError, match=r"trial T01: half could not be measured.*line 13 in half_"):
        value_of(measure, TrialRecord({"nice": 4, "trial_id": "T01"}, None))


def test_defect_of_visavis_is_no_mistake_of_a_user() -> None:
    with pytest.raises(AttributeError) as caught:
        languages_of(None)  # type: ignore[arg-type]  # as a defect might call it
    trace = caught.value.__traceback__
    assert trace is not None
    assert trace.tb_next is not None
    assert users_mistake(caught.value.with_traceback(trace.tb_next)) is None


def run(folder: Path, *options: str) -> str:
    """Perform a fast session in a folder's lab; return what was said."""
    file = str(folder / "meet.py")
    lab = CONFIG.read_text("utf-8")
    (folder / "lab_config.yaml").write_text(lab, "utf-8")
    arguments = ["run", file, "--fast", "--config", str(folder / "lab_config.yaml"), *options]
    result = CliRunner().invoke(app, arguments)
    if isinstance(result.exception, Exception):
        return str(users_mistake(result.exception) or result.exception)
    return " ".join(result.output.split())


def test_session_without_a_trial_binds_no_design(tmp_path: Path) -> None:
    written(tmp_path, 'return "4"', "return seen.nothing")
    assert "line 24 in answer(" in run(tmp_path, "--participant", "1")
    (session,) = tmp_path.rglob("ses-001")
    assert not holds_trial(session)
    written(tmp_path, '["idle", "wave"]', '["idle", "talk"]')
    said = run(tmp_path, "--participant", "1")
    assert "add --session 2" in said
    assert "another design" not in run(tmp_path, "--participant", "1", "--session", "2")
    (second,) = tmp_path.rglob("ses-002")
    assert {"idle", "talk"} == set(Recording(second).trials()["motion"])
    # From the first trial on the design is what it was.
    written(tmp_path, '["idle", "wave"]', '["idle", "walk"]')
    assert "were made with another design" in run(tmp_path, "--participant", "2")


def test_two_questions_of_one_name_are_refused(tmp_path: Path) -> None:
    again = 'Rating("nice", 1, 7))\n    yield t.ask(Rating("nice", 1, 5))'
    path = written(tmp_path, 'Rating("nice", 1, 7))', again)
    with pytest.raises(DesignError, match="asks two questions called 'nice', of which only the"):
        find_study(str(path)).experiment({})


def test_an_answer_called_as_a_measure_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, 'Measure("half",', 'Measure("nice",')
    with pytest.raises(DesignError, match="the answer nice has the column 'nice', which is a meas"):
        find_study(str(path)).experiment_to_run({})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            't.show(Text("a", height_deg="5"), 1)',
            "Text 'a': height_deg is '5'; it takes a number, without",
        ),
        ('t.show(Text("a", at_deg=3), 1)', r"at_deg is 3; it takes two numbers, such as \(5, 0\)"),
        ('t.show(Text("a", colour=3), 1)', "colour is 3; it takes a text or 3 whole numbers"),
        ('t.show(Grating(phase_deg="45"), 1)', "phase_deg is '45'; it takes a number, without"),
        ('t.show(Grating(phase_deg=float("nan")), 1)', "phase_deg is nan; give degrees"),
        ('t.show(Tone("440"))', "Tone: frequency_hz is '440'; it takes a number"),
        ('t.show(Text("a"), "2")', "t.show: seconds is '2'; it takes a number, without quotes"),
        ('t.show(Text("a"), 1, reveal="gaze", window_deg="5")', "t.show: window_deg is '5'"),
        ('t.show(Text("a"), 1, until=gaze_on("a", "1"))', "gaze_on: seconds is '1'; it takes a n"),
        ('t.ask(Rating("nice", "1", 7))', "Rating 'nice': low is '1'; it takes a whole number"),
    ],
)
def test_a_value_of_another_kind_is_refused_with_what_its_argument_takes(
    call: str, words: str, tmp_path: Path
) -> None:
    path = written(tmp_path, 't.ask(Rating("nice", 1, 7))', call)
    path.write_text(
        "from visavis import Grating, Text, Tone, gaze_on\n" + path.read_text("utf-8"), "utf-8"
    )
    with pytest.raises(DesignError, match=f"meet.py, line 20: .*{words}"):
        find_study(str(path)).experiment({})


def test_what_a_comparison_expects_is_a_text(tmp_path: Path) -> None:
    compare = 'compare=[Compare("nice", within="motion", expects={"motion": "a > b"})]'
    path = written(tmp_path, "uses=[]", f"uses=[], {compare}")
    path.write_text("from visavis import Compare\n" + path.read_text("utf-8"), "utf-8")
    with pytest.raises(
        DesignError, match=r"Compare 'nice': expects is {'motion': .*; it takes a text"
    ):
        find_study(str(path))


@pytest.mark.parametrize(
    ("call", "names"),
    [
        ('t.show(Shape("blob"))', ["rectangle", "ellipse", "cross", "triangle"]),
        ('t.show(Text("a", colour="#12"))', ["black", "pink"]),
        ('t.show(Panorama("a.png", stereo="x"))', ["none", "top-bottom", "left-right"]),
        ('t.show(Text("a"), 1, reveal="mouse")', ["pointer", "around gaze"]),
        ('t.show(Scene("person", motion="zzz"), 1)', ["walk", "wave"]),
    ],
)
def test_a_name_that_is_not_there_is_answered_with_every_name_once(
    call: str, names: list[str], tmp_path: Path
) -> None:
    path = written(tmp_path, 't.ask(Rating("nice", 1, 7))', call)
    text = "from visavis import Panorama, Shape, Text\n" + path.read_text("utf-8")
    path.write_text(text, "utf-8")
    with pytest.raises(DesignError) as caught:
        find_study(str(path)).experiment({})
    assert [1] * len(names) == [str(caught.value).count(name) for name in names]


def test_an_option_or_key_that_is_named_twice_is_refused() -> None:
    with pytest.raises(DesignError, match="keys answer: one of its controls is there twice: f, f"):
        Keys("f", "f")
    with pytest.raises(DesignError, match="choice nice: one of its options is there twice: a, b"):
        Choice("nice", ["a", "b", "a"])


def test_a_function_that_is_no_step_of_a_trial_is_named_as_it_is_called(tmp_path: Path) -> None:
    call = 'detection(5, yes="a", signal="b", present="c")'
    path = written(tmp_path, 't.ask(Rating("nice", 1, 7))', call)
    path.write_text("from visavis import detection\n" + path.read_text("utf-8"), "utf-8")
    with pytest.raises(DesignError, match=r"line 20: .*: detection: answer is 5; it takes a text"):
        find_study(str(path)).experiment({})

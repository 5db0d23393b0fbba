"""Notes and exclusions by hand, after the session: they count, and are in the report by name."""

import shutil
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import visavis
from tests.sessions import STUDIES
from tests.store import STORE
from visavis.cli.main import app
from visavis.lab.errors import LabError, UsageError
from visavis.recording.remarks import REMARKS_NAME
from visavis.running.sessions.folder_check import repair_study, study_problems


def recorded_study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three people of a small study; tests of other files take it, too."""

    def simulate(out: Path) -> Path:
        many = {"repetitions": 4}
        study = STUDIES / "asking.py"
        return visavis.simulate(study, 3, output=out, parameters=many, processes=1).path

    return STORE.share("three of asking", simulate, tmp_path_factory.mktemp("out"))


recorded = pytest.fixture(recorded_study, scope="module")


@pytest.fixture
def folder(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "simulated" / recorded.name))


def said(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments)
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exception is None, result.output
    return " ".join(result.output.split())


def trials(folder: Path) -> pd.DataFrame:
    rows = visavis.open_study(folder).trials()
    return rows[~rows["is_practice"].astype(bool)].set_index(["participant", "trial_id"])


def test_trial_and_person_are_left_out_by_hand_with_reason_and_author(folder: Path) -> None:
    before = trials(folder)
    (first, *_), *_ = before.index.to_list()
    trial = before.loc[first].index[0]
    printed = said(
        "exclude",
        str(folder),
        "1",
        "--trial",
        trial,
        "--reason",
        "a phone rang",
        "--by",
        "A. Meier",
    )
    assert f"visavis analyse {folder}" in printed
    said("exclude", str(folder), "S02C", "--reason", "had taken part before", "--by", "A. Meier")
    after = trials(folder)
    assert not after.loc[(first, trial), "is_analysed"]
    assert "by hand: a phone rang (A. Meier, 2" in after.loc[(first, trial), "left_out_because"]
    assert not after.loc["S02C", "is_analysed"].any()
    assert after.loc["S02C", "left_out_because"].str.contains("had taken part before").all()
    assert before["is_analysed"].sum() - 1 - len(before.loc["S02C"]) == after["is_analysed"].sum()


def test_report_tells_of_notes_and_exclusions_by_hand(folder: Path) -> None:
    said("note", str(folder), "3", "asked whether they were real", "--by", "B. Chen")
    said("exclude", str(folder), "2", "--reason", "had taken part before", "--by", "A. Meier")
    with pytest.warns(UserWarning, match="left out: participant S02C, by hand: had taken part"):
        report = visavis.analyse(folder, processes=1).read_text("utf-8")
    for words in (
        "Notes and exclusions by hand",
        "asked whether they were real",
        "B. Chen",
        "had taken part before",
        "by hand, after the session",
    ):
        assert words in report
    table = pd.read_csv(folder / "derived" / "participants.csv").set_index("participant")
    assert not table.loc["S02C", "is_analysed"]
    assert table.loc["S03D", "is_analysed"]


def test_exclusion_by_hand_is_taken_back(folder: Path) -> None:
    before = trials(folder)["is_analysed"]
    said("exclude", str(folder), "2", "--reason", "mistaken for another", "--by", "A. Meier")
    said("exclude", str(folder), "2", "--take-back", "--reason", "it was not", "--by", "A. Meier")
    assert before.equals(trials(folder)["is_analysed"])
    with pytest.raises(UsageError, match="S02C was not left out by hand; left out are: none"):
        said("exclude", str(folder), "2", "--take-back", "--reason", "again", "--by", "A. Meier")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("9", "--reason", "x"), "9 has no session there; there are S01B, S02C, S03D"),
        (("1", "--trial", "T99", "--reason", "x"), "S01B has no trial T99"),
        (("1", "--session", "2", "--reason", "x"), "S01B has no session 2; there are 1"),
        (("1", "--reason", " "), "nothing is said"),
    ],
)
def test_remark_on_what_is_not_there_is_refused(
    folder: Path, arguments: tuple[str, ...], told: str
) -> None:
    with pytest.raises(UsageError, match=told):
        said("exclude", str(folder), *arguments)


def test_damaged_list_of_remarks_is_named_and_put_back(folder: Path) -> None:
    said("note", str(folder), "1", "came late", "--by", "A. Meier")
    assert () == study_problems(folder)
    path = folder / "sub-S01B" / REMARKS_NAME
    path.write_bytes(path.read_bytes().replace(b"late", b"soon"))
    assert any(REMARKS_NAME in problem for problem in study_problems(folder))
    assert any(REMARKS_NAME in repair for repair in repair_study(folder))
    assert () == study_problems(folder)

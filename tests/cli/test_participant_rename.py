"""An identifier that was given by mistake is corrected everywhere it stands."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import visavis
from tests.cli.test_remarks import recorded_study
from tests.sessions import STUDIES
from visavis.cli.main import app
from visavis.lab.clock import SystemClock
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import LedgerError, UsageError
from visavis.protocol.people.key_file import KeyFile
from visavis.protocol.people.ledger import Ledger
from visavis.recording.lock import SessionLock
from visavis.recording.manifest import read_manifest
from visavis.recording.remarks import Remark, add_remark, remarks_of
from visavis.running.sessions import renaming
from visavis.running.sessions.folder_check import study_problems
from visavis.running.sessions.renaming import rename_participant

recorded = pytest.fixture(recorded_study, scope="module")


@pytest.fixture
def folder(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "data" / "simulated" / recorded.name))


def ledger_of(folder: Path) -> Ledger:
    return Ledger(folder, SystemClock(), prefix="S")


def renamed(folder: Path, who: str = "1", number: int = 17) -> str:
    outcome = rename_participant(
        folder, ledger_of(folder), who, number, reason="mistyped", author="A. Meier", key_file=None
    )
    return outcome.person.label


def test_every_place_names_the_right_identifier_and_recordings_stay_as_they_are(
    folder: Path, tmp_path: Path
) -> None:
    before = visavis.open_study(folder).trials()
    part = Path("ses-001") / "part-01"
    bytes_before = {p.name: p.read_bytes() for p in sorted((folder / "sub-S01B" / part).iterdir())}
    add_remark(folder / "sub-S01B", Remark("note", "S01B", 0, "", "was late", "A. Meier", "2026"))
    keys = KeyFile(tmp_path / "keys", folder.name, [folder])
    keys.identify("S01B", {"name": "Ada"})
    outcome = rename_participant(
        folder, ledger_of(folder), "S01B", 17, reason="mistyped", author="A. Meier", key_file=keys
    )
    label = outcome.person.label
    assert ("S17U", "S01B", 1) == (label, outcome.former, outcome.sessions)
    assert not (folder / "sub-S01B").exists()
    assert label == read_manifest(folder / f"sub-{label}" / "ses-001").participant
    assert [label] == [r.participant for r in remarks_of(folder / f"sub-{label}")]
    assert (None, {"name": "Ada"}) == (keys.identity("S01B"), keys.identity(label))
    after = visavis.open_study(folder).trials()
    renamed_before = before["participant"].replace({"S01B": label})
    assert sorted(renamed_before) == sorted(after["participant"])
    assert () == study_problems(folder)
    assert bytes_before == {
        p.name: p.read_bytes() for p in sorted((folder / f"sub-{label}" / part).iterdir())
    }


def test_the_ledger_says_who_corrected_what_and_never_issues_the_former_identifier(
    folder: Path,
) -> None:
    label, ledger = renamed(folder), ledger_of(folder)
    (first, *_) = ledger.list()
    assert (label, 17, 0, ("S01B",)) == (
        first.label,
        first.number,
        first.index,
        first.former_labels,
    )
    text = ledger.path.read_text(encoding="utf-8")
    assert '"event":"renamed","label":"S01B","to":"S17U"' in text
    assert '"reason":"mistyped","author":"A. Meier"' in text
    with pytest.raises(LedgerError, match="S01B of asking was corrected to S17U; say S17U"):
        ledger.resolve("1")
    with pytest.raises(LedgerError, match="never used twice"):
        ledger.add(1)
    assert 18 == ledger.add().number


@pytest.mark.parametrize("happened", ["ledger", "folder", "manifest"])
def test_a_renaming_that_was_killed_is_finished_by_repeating_it(
    happened: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    stop: dict[str, tuple[object, str]] = {
        "ledger": (Path, "rename"),
        "folder": (renaming, "write_manifest"),
        "manifest": (renaming, "list_renaming"),
    }
    with monkeypatch.context() as patch:
        patch.setattr(*stop[happened], killed)
        with pytest.raises(KeyboardInterrupt):
            renamed(folder)
    assert "S17U" == renamed(folder)
    assert () == study_problems(folder)
    assert 1 == ledger_of(folder).path.read_text(encoding="utf-8").count('"renamed"')


def test_a_number_that_is_taken_and_a_session_that_runs_change_nothing(folder: Path) -> None:
    with pytest.raises(LedgerError, match="S02C of asking is in the ledger"):
        renamed(folder, number=2)
    lock = SessionLock(folder / "sub-S01B" / "ses-001")
    with pytest.raises(UsageError, match="is running"):
        renamed(folder)
    lock.release()
    assert (folder / "sub-S01B").is_dir()
    assert '"renamed"' not in ledger_of(folder).path.read_text(encoding="utf-8")


def test_the_command_says_what_it_did(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    monkeypatch.chdir(tmp_path)
    study = str(STUDIES / "asking.py")
    said = ["participant", "rename", study, "1", "17", "--reason", "mistyped", "--devices", "sim"]
    result = CliRunner().invoke(app, said)
    assert result.exception is None, result.output
    assert "S01B is S17U now: 1 sessions" in result.output
    assert (folder / "sub-S17U").is_dir()

"""A study's parameters are given once, before or with its first person, and then hold for all."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.faults.sessions import CONFIG
from visavis.cli.app import load_lab
from visavis.cli.main import app
from visavis.cli.studies import study_here
from visavis.lab.clock import SimClock
from visavis.lab.errors import ConfigError, LedgerError, RecordingError, UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.recording.folder import create_session
from visavis.recording.manifest import Manifest, read_manifest
from visavis.recording.provenance import provenance
from visavis.running.sessions.data_root import DataDisk
from visavis.running.sessions.study_folder import StudySettings, read_settings


@pytest.fixture
def lab_config(tmp_path: Path) -> Path:
    path = tmp_path / "lab_config.yaml"
    path.write_text(CONFIG.read_text("utf-8"), "utf-8")
    return path


def visavis(config: Path, *arguments: str) -> str:
    result = CliRunner().invoke(app, [*arguments, "--config", str(config)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert 0 == result.exit_code, result.output
    return result.output


@pytest.mark.parametrize("devices", ["real", "sim"])
def test_people_can_be_dealt_to_groups_from_the_first_one_on(
    devices: str, lab_config: Path
) -> None:
    here = ("--devices", devices)
    design = ("--set", "groups=[haptics,control]")
    first = visavis(lab_config, "participant", "add", "crowd", *here, *design)
    further = [visavis(lab_config, "participant", "add", "crowd", *here) for _ in range(3)]
    groups = ["control" if "group control" in text else "haptics" for text in (first, *further)]
    assert {"control": 2, "haptics": 2} == {g: groups.count(g) for g in set(groups)}
    plan = visavis(lab_config, "plan", "crowd", "--participant", "1", "--json", *here)
    assert groups[0] == json.loads(plan)["group"]


def test_a_plan_can_be_seen_with_parameters_before_the_study_exists(lab_config: Path) -> None:
    def plan(*more: str) -> dict[str, Any]:
        arguments = ("plan", "crowd", "--participant", "1", "--json", *more)
        found: dict[str, Any] = json.loads(visavis(lab_config, *arguments))
        return found

    assert 2 * 3 == sum(
        not trial["is_practice"]
        for block in plan("--set", "configurations=[1,2]")["blocks"]
        for trial in block["trials"]
    )
    assert not (lab_config.parent / "data").exists()
    assert {plan("--set", "groups=[haptics,control]")["group"]} <= {"haptics", "control"}


def place_of(text: str) -> str:
    found = re.search(r"place (\d+)", text)
    assert found is not None, text
    return found[1]


@pytest.mark.parametrize("devices", ["real", "sim"])
def test_plan_shows_the_place_that_adding_gives(devices: str, lab_config: Path) -> None:
    here = ("--devices", devices)
    for number, place in (("7", "1"), ("3", "2")):
        shown = visavis(lab_config, "plan", "stare", "--participant", number, *here)
        assert "not in the ledger yet" in shown
        nobody = visavis(lab_config, "plan", "stare", *here)
        assert "not in the ledger" not in nobody
        added = visavis(lab_config, "participant", "add", "stare", number, *here)
        again = visavis(lab_config, "plan", "stare", "--participant", number, *here)
        assert "not in the ledger" not in again
        assert [place] * 4 == [place_of(text) for text in (shown, nobody, added, again)]


def test_a_session_of_somebody_not_registered_takes_the_first_free_place(lab_config: Path) -> None:
    lab = load_lab(lab_config, "sim", quiet=True)
    settings = StudySettings("stare", 1, is_simulated=True)
    entry = study_here("stare", lab).participant(settings, "07")
    assert ("S07H", 0) == (entry.label, entry.index)


def test_a_number_to_issue_may_be_typed_as_its_label(lab_config: Path) -> None:
    add = ("participant", "add", "stare")
    assert "07H is participant 7" in visavis(lab_config, *add, "07h", "--devices", "real")
    assert "S03D is participant 3" in visavis(lab_config, *add, "03D", "--devices", "sim")
    with pytest.raises(LedgerError, match="the right check letter"):
        visavis(lab_config, *add, "08H", "--devices", "real")


def test_a_study_is_not_simulated_to_a_data_root_that_keeps_no_files(
    lab_config: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nothing = DataDisk(None, "this place keeps no files", "set data_root elsewhere")
    monkeypatch.setattr("visavis.running.sessions.data_root.data_disk", lambda lab: nothing)
    with pytest.raises(RecordingError, match=r"keeps no files; set data_root elsewhere.*lab_con"):
        visavis(lab_config, "simulate", "stare", "--participants", "1")


def test_a_place_can_be_taken_over_from_the_command_line(lab_config: Path) -> None:
    visavis(lab_config, "participant", "add", "stare", "--devices", "real")
    gone = ("participant", "withdraw", "stare", "1", "--yes", "--devices", "real")
    (lab_config.parent / "data/real/stare/sub-01B/ses-001").mkdir(parents=True)
    visavis(lab_config, *gone)
    taken = visavis(
        lab_config, "participant", "add", "stare", "--replaces", "01B", "--devices", "real"
    )
    assert "1" == place_of(taken)


@pytest.mark.parametrize(("where", "status"), [("browser", "withdrawing"), ("devices", "active")])
def test_withdrawing_who_is_at_a_page_is_left_to_its_server_and_refused_elsewhere(
    lab_config: Path, where: str, status: str
) -> None:
    visavis(lab_config, "participant", "add", "stare", "--devices", "real")
    root = lab_config.parent / "data"
    manifest = Manifest(
        "stare", "01B", 1, False, {}, 1, {"on": where, "devices": {}}, (), "", "", provenance()
    )
    gone = ("participant", "withdraw", "stare", "01B", "--yes", "--devices", "real")
    with create_session(root, manifest) as folder:
        if where == "browser":
            assert "01B is at a page now" in " ".join(visavis(lab_config, *gone).split())
        else:
            with pytest.raises(UsageError, match="is running; end it first"):
                visavis(lab_config, *gone)
        assert folder.path.exists()
    ledger = Ledger(root / "real" / "stare", SimClock())
    assert [status] == [entry.status for entry in ledger.list()]
    visavis(lab_config, *gone)
    assert ["withdrawn"] == [entry.status for entry in ledger.list()]
    assert not folder.path.exists()


def test_other_parameters_than_those_begun_with_are_refused_by_name(lab_config: Path) -> None:
    visavis(lab_config, "participant", "add", "crowd", "--set", "limit_s=90")
    for command in (("participant", "add", "crowd"), ("plan", "crowd", "--participant", "1")):
        with pytest.raises(UsageError, match="begun with limit_s=90"):
            visavis(lab_config, *command, "--set", "limit_s=60")


def test_parameters_can_come_with_the_first_session_of_somebody_registered_before(
    lab_config: Path,
) -> None:
    visavis(lab_config, "participant", "add", "stare", "--devices", "sim")
    few = ("trial_s=1", "intertrial_s=0.5", "practice_s=1", "repetitions=1")
    here = [text for setting in few for text in ("--set", setting)]
    visavis(lab_config, "plan", "stare", "--participant", "1", "--devices", "sim", *here)
    visavis(lab_config, "run", "stare", "--participant", "1", "--devices", "sim", "--fast", *here)

    settings = read_settings(lab_config.parent / "data" / "simulated" / "stare")
    assert settings is not None
    assert {"trial_s": 1, "intertrial_s": 0.5, "practice_s": 1, "repetitions": 1} == (
        settings.parameters
    )
    with pytest.raises(UsageError, match="which holds for all of its sessions"):
        visavis(
            lab_config,
            "run",
            "stare",
            "--participant",
            "2",
            "--devices",
            "sim",
            "--fast",
            *here,
            "--set",
            "pad_deg=2",
        )


def test_parameters_that_would_move_somebody_to_another_group_are_refused(
    lab_config: Path,
) -> None:
    for _ in range(4):
        visavis(lab_config, "participant", "add", "crowd", "--devices", "sim")
    with pytest.raises(UsageError, match="begun with no --set"):
        visavis(
            lab_config,
            "participant",
            "add",
            "crowd",
            "--devices",
            "sim",
            "--set",
            "groups=[haptics,control]",
        )


@pytest.fixture
def bilingual(lab_config: Path) -> Path:
    """Return a study beside the configuration that says everything in English and German."""
    file = lab_config.parent / "greet.py"
    file.write_text(
        """from visavis import Choice, Factor, Study

study = Study("greet", factors=[Factor("way", ["a", "b"])], texts="texts", calibrate=False, uses=[])


@study.trial
def trial(t):
    yield t.ask(Choice("do", ["greet", "wait"]))
""",
        "utf-8",
    )
    (file.parent / "texts").mkdir()
    (file.parent / "texts/en.yaml").write_text("questions:\n  do: What would you do?\n", "utf-8")
    (file.parent / "texts/de.yaml").write_text("questions:\n  do: Was tun Sie?\n", "utf-8")
    return file


@pytest.mark.parametrize("verb", ["plan", "run"])
def test_a_text_missing_in_one_language_is_refused_by_what_uses_it(
    lab_config: Path, bilingual: Path, verb: str
) -> None:
    german = bilingual.parent / "texts/de.yaml"
    german.write_text("practice: Zuerst.\n", "utf-8")
    (bilingual.parent / "texts/en.yaml").write_text(
        "practice: First.\nquestions:\n  do: What would you do?\nlabels:\n  way: how\n", "utf-8"
    )
    fast = ("--devices", "sim", "--fast") if verb == "run" else ()
    wanted = (verb, str(bilingual), "--participant", "1", *fast)

    with pytest.raises(ConfigError) as refused:
        visavis(lab_config, *wanted, "--language", "de")

    assert f"{german} has no text 'questions.do', which" in str(refused.value)
    assert "way" not in str(refused.value)
    assert "trial" in visavis(lab_config, "plan", str(bilingual))


def test_who_takes_part_in_a_begun_study_may_read_another_language(
    lab_config: Path, bilingual: Path
) -> None:
    run = ("run", str(bilingual), "--devices", "sim", "--fast", "--participant")
    visavis(lab_config, *run, "1")
    visavis(lab_config, *run, "2", "--language", "de")
    visavis(lab_config, *run, "3")
    sessions = sorted((lab_config.parent / "data/simulated/greet").glob("sub-*/ses-*"))
    assert ["en", "de", "en"] == [read_manifest(s).plan["parameters"]["language"] for s in sessions]
    for number in ("1", "4"):
        with pytest.raises(ConfigError, match=r"has no fr.yaml; it has de, en"):
            visavis(lab_config, "plan", str(bilingual), "--participant", number, "--language", "fr")

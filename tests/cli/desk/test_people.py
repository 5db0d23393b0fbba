"""Who is here today, how far they are, and what to do next."""

import os
from collections.abc import Collection
from pathlib import Path
from typing import Any

import pytest

from tests.faults.sessions import ScriptedOperator, lab, path_of, perform
from visavis.cli.commands.desk import _desk_server
from visavis.cli.desk.people import Verdicts, people_today
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import ConfigError, SessionAborted
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.recording.folder import study_dir
from visavis.recording.reader import Recording
from visavis.running.sessions.study_folder import SIMULATED_PREFIX, StudySettings, settle


@pytest.fixture
def config(tmp_path: Path) -> LabConfig:
    made = lab(tmp_path)
    folder = study_dir(tmp_path, "stare", is_simulated=True)
    settle(folder, StudySettings("stare", 1, is_simulated=True), seed_given=False, fits=bool)
    ledger = Ledger(folder, SystemClock(), prefix=SIMULATED_PREFIX)
    ledger.add(1)
    ledger.add(2)
    # the session is that of somebody whose label the ledger gives
    path_of(made).parent.parent.mkdir(exist_ok=True)
    (folder / "sub-S01B").symlink_to(folder / "sub-S01")
    return made


def today(config: LabConfig, running: Collection[str] = ()) -> dict[str, Any]:
    (study,) = people_today(config, Verdicts(), running)
    return {person["label"]: person for person in study["people"]} | {"before": study["before"]}


def session_of(config: LabConfig) -> Path:
    return study_dir(config.data_root, "stare", is_simulated=True) / "sub-S01B/ses-001"


def test_somebody_still_to_come_is_shown_with_the_command(config: LabConfig) -> None:
    people = today(config)
    assert "to come" == people["S02C"]["state"]
    assert "visavis run stare --participant S02C" == people["S02C"]["command"]


def test_a_study_that_the_lab_knows_by_no_name_is_run_by_its_file(config: LabConfig) -> None:
    own = study_dir(config.data_root, "duel", is_simulated=True)
    settle(own, StudySettings("duel", 1, is_simulated=True), seed_given=False, fits=bool)
    Ledger(own, SystemClock(), prefix=SIMULATED_PREFIX).add(1)
    people = {study["study"]: study for study in people_today(config, Verdicts())}
    (person,) = people["duel"]["people"]
    assert "visavis run ./duel.py --participant S01B" == person["command"]


def test_a_session_broken_off_says_what_to_redo_and_a_whole_one_that_they_can_leave(
    config: LabConfig,
) -> None:
    script = ((SessionState.TRIAL, 3, 5, Command(Action.ABORT)),)
    with pytest.raises(SessionAborted):
        perform(config, ScriptedOperator(*script), trial_s=1.0)
    people = today(config)["S01B"]
    assert ("interrupted", "red") == (people["state"], people["verdict"]["level"])
    assert f"visavis resume {session_of(config)}" == people["command"]
    assert (2, 7) == (people["verdict"]["done"], people["verdict"]["planned"])
    assert any("visavis resume" in step for step in people["verdict"]["redo"])


def test_a_whole_session_of_today_is_judged_and_one_of_another_day_counted(
    config: LabConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    perform(config, trial_s=1.0)
    people = today(config)["S01B"]
    assert ("complete", "") == (people["state"], people["command"])
    assert people["verdict"]["answer"].startswith("They can leave")
    monkeypatch.setattr("visavis.cli.desk.people._is_today", lambda changed_s: False)
    people = today(config)
    assert ("S01B" in people, 1) == (False, people["before"])


def test_a_session_broken_off_on_another_day_still_waits_to_be_gone_on_with(
    config: LabConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SessionAborted):
        perform(config, ScriptedOperator((SessionState.TRIAL, 3, 5, Command(Action.ABORT))))
    monkeypatch.setattr("visavis.cli.desk.people._is_today", lambda changed_s: False)
    people = today(config)
    assert ("interrupted", 0) == (people["S01B"]["state"], people["before"])


def test_a_session_is_read_once_for_as_long_as_it_does_not_change(
    config: LabConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    perform(config, trial_s=1.0)
    verdicts = Verdicts()
    first = people_today(config, verdicts)

    def read_again(path: Path) -> Recording:
        raise AssertionError(f"{path} was read again")

    monkeypatch.setattr("visavis.cli.desk.people.Recording", read_again)
    assert first == people_today(config, verdicts)
    os.utime(session_of(config) / "manifest.json")  # as going on with it does
    with pytest.raises(AssertionError, match="ses-001 was read again"):
        people_today(config, verdicts)


def test_while_a_session_goes_on_no_other_is_judged(config: LabConfig) -> None:
    perform(config, trial_s=1.0)
    people = today(config, running=["elsewhere"])["S01B"]
    assert ("complete", None) == (people["state"], people["verdict"])
    assert "running" == today(config, running=[str(session_of(config).resolve())])["S01B"]["state"]


def test_a_ledger_that_cannot_be_read_is_told_and_hides_no_other_study(config: LabConfig) -> None:
    other = study_dir(config.data_root, "crowd", is_simulated=True)
    settle(other, StudySettings("crowd", 1, is_simulated=True), seed_given=False, fits=bool)
    Ledger(other, SystemClock(), prefix=SIMULATED_PREFIX).add(1)
    for file in other.glob("participants*.jsonl"):
        file.chmod(0o600)
        file.write_text("{no\n{no\n", "utf-8")
    people = {study["study"]: study for study in people_today(config, Verdicts())}
    assert people["crowd"]["problem"]
    assert 2 == len(people["stare"]["people"])


def test_a_session_gone_on_with_today_is_todays_whenever_it_was_begun(config: LabConfig) -> None:
    perform(config, trial_s=1.0)  # on the virtual clock, whose day is another
    assert "complete" == today(config)["S01B"]["state"]
    manifest = session_of(config) / "manifest.json"
    days_ago_s = manifest.stat().st_mtime - 2 * 86400
    os.utime(manifest, (days_ago_s, days_ago_s))
    assert 1 == today(config)["before"]


def test_without_the_servers_library_the_way_to_get_it_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError("gone", name=name)

    monkeypatch.setattr("importlib.import_module", missing)
    with pytest.raises(ConfigError, match=r"pip install 'visavis\[browser\]'"):
        _desk_server()

"""A session, or the rest of one, without a device the study can spare: flagged, told, whole."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tests.experiments.crowd.sessions import request as crowd_request
from tests.experiments.crowd.tables import measured
from tests.faults.sessions import CONFIG, ScriptedOperator, lab
from tests.sessions import STUDIES, opened
from visavis import Choice, Factor, Keys, Rating, Study
from visavis.analysis.session_check import check_session
from visavis.cli.main import app
from visavis.experiments.crowd.measures import MeasureParameters
from visavis.lab.errors import DeviceError, UsageError
from visavis.protocol.plan.experiment import spare_roles_of
from visavis.protocol.session.operator import Action, Command
from visavis.protocol.session.states import SessionState
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.study.experiment import StudyExperiment

BAND = "armband_right_forearm"
GONE = [{"kind": "late_start"}, {"kind": "disconnect"}]


def asking(data_root: Path, **faults: Any) -> Request:
    config = lab(data_root)
    devices = dict(config.devices)
    for role, rows in faults.items():
        options = {**devices[role].options, "faults": rows}
        devices[role] = devices[role].model_copy(update={"options": options})
    study = opened("asking")
    config = config.model_copy(update={"data_root": data_root, "devices": devices})
    return simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)


def findings(recording: Recording) -> list[str]:
    return [f"{f.subject}: {f.message}" for f in check_session(recording).findings]


def test_a_dead_band_ends_neither_a_session_nor_its_resume(tmp_path: Path) -> None:
    wanted = crowd_request(tmp_path, faults={BAND: GONE})
    with pytest.raises(DeviceError) as ended:
        perform_new(wanted)
    assert BAND == ended.value.role
    path = session_dir(tmp_path, "crowd", "S01B", 1, is_simulated=True)
    with pytest.raises(DeviceError):
        perform_rest(wanted, path)

    recording = Recording(perform_rest(replace(wanted, without=(BAND,)), path))
    assert "complete" == recording.status
    rows = recording.trials()
    assert {"complete"} == set(rows["status"])
    assert all(f"{BAND}_lost" in flags.split(";") for flags in rows["flags"])
    assert f"{BAND}: the operator went on without it; trials are flagged" in findings(recording)
    _, walks = measured(recording, MeasureParameters(surface="capsules"))
    assert 3 == len(walks)
    assert all(f"{BAND}_lost" in walk["flags"] for walk in walks)


def test_what_a_study_needs_cannot_be_left_out(tmp_path: Path) -> None:
    wanted = replace(crowd_request(tmp_path), without=("body_tracker",))
    with pytest.raises(UsageError, match="crowd cannot go on without 'body_tracker': it can do w"):
        perform_new(wanted)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("role", ["responses", "eye_tracker"])
def test_a_device_on_which_nothing_rests_may_stay_away(role: str, tmp_path: Path) -> None:
    away = [{"kind": "disconnect", "start_s": 0.3}]
    go_on = (SessionState.PAUSED, 1, 10, Command(Action.ADVANCE))
    operator = ScriptedOperator(go_on)
    wanted = replace(asking(tmp_path, **{role: away}), operator=operator, lost_device_s=10.0)
    recording = Recording(perform_new(wanted))
    assert "complete" == recording.status
    rows = recording.trials()
    assert rows["flags"].str.contains(f"{role}_lost").all()
    assert any("you can go on without it" in wait for wait in operator.waits)
    went_on = operator.seen[max(i for i, s in enumerate(operator.seen) if s.waiting) + 1 :]
    assert role in {fault.role for status in went_on for fault in status.faults}
    assert {"warning"} == {fault.severity for status in went_on for fault in status.faults}
    assert f"{role}: the operator went on without it; trials are flagged" in findings(recording)


def test_the_report_says_how_many_trials_lacked_a_device(tmp_path: Path) -> None:
    whole = Recording(perform_new(asking(tmp_path)))
    asked = asking(tmp_path)
    lacking = replace(asked, person=replace(asked.person, label="S02"), without=("responses",))
    study = opened("asking")
    taken = [study.measure(r) for r in (whole, Recording(perform_new(lacking)))]
    page = study.analyse(
        taken, tmp_path / "out", is_simulated=True, commands=(), example=whole
    ).read_text("utf-8")
    row = re.search(r">responses_lost</t[dh]>\s*<td[^>]*>(\d+)</td>\s*<td[^>]*>(\d+)", page)
    assert row is not None
    assert ("2", "1") == row.groups()


def test_what_can_be_spared_follows_from_what_a_study_rests_on() -> None:
    def spared(response: Any = None, **declared: Any) -> tuple[str, ...]:
        listed = () if response is None else (response,)
        study = Study("one", factors=[Factor("eyes", ["a", "b"])], responses=listed, **declared)

        @study.trial
        def trial(t: Any) -> Any:
            yield t.dark(0.1)

        return spare_roles_of(StudyExperiment(study, {}))

    rating = Rating("seen")
    assert ("responses",) == spared()
    assert ("body_tracker",) == spared(rating, answer_by="ray")
    assert ("eye_tracker", "responses") == spared(validate=False)
    assert ("eye_tracker", "body_tracker", "responses") == spared(rating, calibrate=False)
    assert ("body_tracker",) == spared(Keys("seen", ("trigger",)), uses=["body_tracker"])
    assert ("responses",) == spared(Choice("seen", ("yes", "no")), uses=[], needs=["armband_left"])
    assert ("armband_left",) == spared(needs=["armband_left"], spares=["armband_left"])


def test_the_way_on_without_a_device_is_printed_and_works(tmp_path: Path) -> None:
    config = tmp_path / "lab_config.yaml"
    text = CONFIG.read_text("utf-8")
    assert text.count("driver: simulated_responses") == 1
    late = "driver: simulated_responses\n    faults: [{kind: late_start}]"
    config.write_text(text.replace("driver: simulated_responses", late), "utf-8")

    def visavis(*arguments: str) -> Any:
        return CliRunner().invoke(app, [*arguments, "--config", str(config)])

    study = str(STUDIES / "asking.py")
    first = visavis("run", study, "--participant", "1", "--fast")
    assert isinstance(first.exception, DeviceError)
    way_on = next(li for li in first.output.splitlines() if "--without" in li).split()
    assert ["--fast", "--without", "responses"] == way_on[-3:]
    again = visavis(*way_on[1:])
    assert 0 == again.exit_code, again.output

import os
import signal
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.commands import COMMANDS, RunningCommand
from tests.faults.sessions import CONFIG, REPOSITORY, events, findings, lab, request
from tests.sessions import SHORT_STARE
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.experiments.stare.study import study
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy
from visavis.running.sessions.perform import perform_new
from visavis.study.experiment import StudyExperiment


class Lenient(OpenedStudy):
    """The study with every validation accepted: there is no time for long ones here."""

    def judge_validation(self, points: Any, rate_hz: float) -> Any:
        """Measure, then accept."""
        return replace(super().judge_validation(points, rate_hz), accepted=True)


class TwoTrials(StudyExperiment):
    """The first two trials of the first block."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        whole = super().plan(participant_index, seed, group)
        block = whole.blocks[1]
        return replace(whole, blocks=(replace(block, trials=block.trials[:2]),))


@pytest.fixture
def captures(monkeypatch: pytest.MonkeyPatch) -> list[PupilCoreSimulator]:
    """Every simulated Pupil Capture that a session is given."""
    made: list[PupilCoreSimulator] = []

    class Kept(PupilCoreSimulator):
        """Capture, which the test can look into."""

        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            made.append(self)

    monkeypatch.setattr("visavis.devices.drivers.pupil.wiring.PupilCoreSimulator", Kept)
    return made


def test_a_session_on_the_system_clock_over_sockets_is_complete(
    tmp_path: Path, captures: list[PupilCoreSimulator]
) -> None:
    parameters = {"trial_s": 0.6, "practice_s": 0.6, "intertrial_s": 0.2, "repetitions": 1}
    recording = Recording(
        perform_new(
            replace(
                request(lab(tmp_path)),
                study=Lenient(study),
                experiment=TwoTrials(study, parameters),
                clock=SystemClock(),
                timing=TargetTiming(60, 200, 20, 60),
            )
        )
    )

    assert "complete" == recording.status
    assert ["complete", "complete"] == list(recording.trials()["status"])
    assert (
        "zmq"
        in next(d for d in recording.manifest.devices if d["role"] == "eye_tracker")["transport"]
    )
    assert recording.trials()["gaze_received"].min() > 20
    assert len(events(recording, "clock_exchanges")[0]["send_device_receive_ns"]) >= 20
    assert () == recording.verify().problems
    assert "2 of 2 planned trials complete" in findings(recording)
    (capture,) = (c for c in captures if c.recordings)  # others heard the rehearsal
    assert ["stare_S01_001_01"] == list(capture.recordings)
    (marks,) = capture.recordings.values()
    words = [mark["label"].split()[:2] for mark in marks]
    trials = list(recording.trials()["trial_id"])
    assert [[edge, trial] for trial in trials for edge in ("trial_start", "trial_end")] == [
        word for word in words if word[0] in ("trial_start", "trial_end")
    ]


@pytest.mark.timeout(600)
@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_an_aborted_session_that_resume_completes(
    tmp_path: Path, sent: signal.Signals
) -> None:
    (tmp_path / "lab_config.yaml").write_text(CONFIG.read_text("utf-8"), "utf-8")
    command = ["-m", "visavis.cli.main"]
    environment = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    running = COMMANDS.start(
        *[*command, "run", "stare", "--participant", "07", *SHORT_STARE],
        cwd=tmp_path,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_for(tmp_path, "*/*/stare/sub-*/ses-001/part-01/frames.arrows", running)
    running.send_signal(sent)
    _, complaint = running.communicate(timeout=60)

    session = next(tmp_path.glob("*/simulated/stare/sub-*/ses-001"))
    assert 3 == running.returncode
    assert "every finished trial is kept" in complaint
    assert f"visavis resume {session}" in complaint.replace("\n", "")
    assert "aborted" == Recording(session).status

    resume = [*command, "resume", str(session), "--fast"]
    resumed = COMMANDS.run(*resume, cwd=tmp_path, env=environment)
    assert 0 == resumed.returncode, resumed.stderr
    assert "complete" == Recording(session).status


def wait_for(folder: Path, pattern: str, process: RunningCommand) -> None:
    """Return once a file that matches holds data; the test's own time limit ends it."""
    clock = SystemClock()
    while not any(p.stat().st_size > 20_000 for p in folder.glob(pattern)):
        assert process.poll() is None, process.communicate()
        clock.sleep_until_ns(clock.now_ns() + NS_PER_S // 20)

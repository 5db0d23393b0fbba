"""Short stare sessions on the virtual clock, with faults on the wire and a scripted operator."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from visavis.analysis.session_check import check_session
from visavis.analysis.session_verdict import SessionCheck
from visavis.experiments.stare.study import study
from visavis.lab.config import DeviceConfig, LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Action, Command, SessionStatus, UnattendedOperator
from visavis.protocol.session.states import SessionState
from visavis.recording.folder import session_dir
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.sessions.perform import perform_new, perform_rest
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.study.experiment import StudyExperiment

CONFIG = EXAMPLE
REPOSITORY = Path(__file__).resolve().parents[2]
TIMING = TargetTiming(100, 300, 600, 900)
TRIAL_S = 4.0
TRIALS = ("T01", "T02", "T03", "T13", "T14", "T15")
PRACTICE_S = 1.0

Rows = Sequence[Mapping[str, Any]]


class FewTrials(StudyExperiment):
    """Training and the first three trials of two blocks."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        whole = super().plan(participant_index, seed, group)
        blocks = tuple(replace(b, trials=b.trials[:3]) for b in whole.blocks[:3])
        return replace(whole, blocks=blocks)


def lab(data_root: Path, *, tracker: Rows = (), headset: Rows = (), **options: Any) -> LabConfig:
    """Return the shipped lab with faults of tracker and headset, at low rates."""
    config = load_config(CONFIG)
    made = {
        "headset": {"display_rate_hz": 30, "faults": list(headset)},
        "eye_tracker": {"rate_hz": 60, "faults": list(tracker), **options},
        "responses": {},
    }
    devices = {
        role: DeviceConfig(
            role=role, driver=config.devices[role].driver, simulated=True, options=chosen
        )
        for role, chosen in made.items()
    }
    roots = {"data_root": data_root, "key_root": data_root.with_name(f"{data_root.name}-keys")}
    return config.model_copy(update={**roots, "devices": devices})


def request(config: LabConfig, operator: Any = None, *, trial_s: float = TRIAL_S) -> Request:
    """Return a session of seven trials."""
    parameters = {
        "trial_s": trial_s,
        "practice_s": PRACTICE_S,
        "intertrial_s": 0.5,
        "repetitions": 1,
    }
    made = simulated_request(
        find_study("stare"), FewTrials(study, parameters), config, label="S01", index=0, seed=1
    )
    return replace(
        made,
        timing=TIMING,
        lost_device_s=20.0,
        operator=operator if operator is not None else UnattendedOperator(),
    )


def perform(config: LabConfig, operator: Any = None, *, trial_s: float = TRIAL_S) -> Recording:
    """Perform a session to its end."""
    return Recording(perform_new(request(config, operator, trial_s=trial_s)))


def resume(config: LabConfig, operator: Any = None) -> Recording:
    """Perform the rest of the session below the data root."""
    return Recording(perform_rest(request(config, operator), path_of(config)))


def path_of(config: LabConfig) -> Path:
    """Return where the session lies."""
    return session_dir(config.data_root, "stare", "S01", 1, is_simulated=True)


class ScriptedOperator:
    """Send commands when a state is reached: (state, how often it was reached, frames, command).

    `trail` holds every state that was seen, `seen` every status; prompts are gone through after a
    few frames.
    """

    status_period_ns = 1

    def __init__(self, *script: tuple[SessionState, int, int, Command]) -> None:
        self._script = list(script)
        self._reached: dict[SessionState, int] = {}
        self._frames = 0
        self._prompted = False
        self.trail: list[SessionState] = []
        self.messages: list[str] = []
        self.prompts: list[str] = []
        self.waits: list[str] = []
        self.seen: list[SessionStatus] = []

    def poll(self) -> Sequence[Command]:
        """Return what the script says now; ADVANCE while a prompt stands."""
        self._frames += 1
        state = self.trail[-1] if self.trail else None
        due = [
            s
            for s in self._script
            if s[0] is state and s[1] == self._reached[s[0]] and self._frames >= s[2]
        ]
        self._script = [s for s in self._script if s not in due]
        commands = [s[3] for s in due]
        if self._prompted and not due:
            commands.append(Command(Action.ADVANCE))
        return commands

    def show(self, status: SessionStatus) -> None:
        """Follow the session."""
        if not self.trail or self.trail[-1] is not status.state:
            self.trail.append(status.state)
            self._reached[status.state] = self._reached.get(status.state, 0) + 1
            self._frames = 0
        self._prompted = bool(status.prompt)
        if status.prompt and status.prompt not in self.prompts:
            self.prompts.append(status.prompt)
        if status.waiting and status.waiting not in self.waits:
            self.waits.append(status.waiting)
        self.seen.append(status)
        self.messages += [m for m in status.messages if m not in self.messages]

    def waits_for_advance(self, prompt: str) -> bool:
        """Wait for the script."""
        return True


def trial_table(recording: Recording) -> pd.DataFrame:
    """Return the trial rows as recorded, by trial and attempt."""
    return recording.trials().set_index(["trial_id", "attempt"], drop=False).sort_index()


def events(recording: Recording, name: str) -> list[dict[str, Any]]:
    """Return the payloads of all events of a name."""
    found = recording.events()
    return list(found.loc[found["name"] == name, "payload"])


def findings(recording: Recording) -> str:
    """Return what `visavis check` says, as one text."""
    return "\n".join(f"{f.subject}: {f.message}" for f in verdict(recording).findings)


def verdict(recording: Recording) -> SessionCheck:
    """Return what `visavis check` makes of a session."""
    return check_session(recording)


def span_s(recording: Recording, trial_id: str) -> tuple[float, float]:
    """Return start and end of a trial's last attempt, seconds of session time."""
    row = recording.trials().set_index("trial_id").loc[trial_id]
    row = row.iloc[-1] if isinstance(row, pd.DataFrame) else row
    return row["t_start_ns"] / 1e9, row["t_end_ns"] / 1e9

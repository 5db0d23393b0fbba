"""Whole sessions on Monado, from their first frame to what `visavis check` says of them.

The simulated participant's head is put into Monado in every frame, so that eyes, head and targets
agree as they do on a person.
"""

import os
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tests.faults.sessions import lab
from tests.genuine.monado import Remote, call
from tests.running.test_every_study import small
from visavis.analysis.session_check import check_session
from visavis.lab.clock import NS_PER_S, SystemClock
from visavis.lab.config import DeviceConfig, LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.protocol.session.gaze_setup import TargetTiming
from visavis.protocol.session.operator import Command, SessionStatus, UnattendedOperator
from visavis.protocol.session.states import SessionState
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import Request, simulated_request
from visavis.study.experiment import StudyExperiment

CLOCK = SystemClock()
OWN = str(Path(__file__).parents[1] / "studies" / "duel.py")
SEED = 2
TIMING = TargetTiming(500, 400, 600, 900)
"""Long enough for the eyes to arrive."""
AWAY_NS = 2 * NS_PER_S


def on_monado(config: LabConfig, *, shows: bool) -> LabConfig:
    """Return a lab whose headset is Monado's; without pictures 30 frames a second are counted."""
    options = {} if shows else {"display_rate_hz": 30.0}
    headset = DeviceConfig(
        role="headset", driver="openxr_headset", simulated=False, options=options
    )
    display = config.display.model_copy(update={"show": "headset" if shows else "none"})
    return config.model_copy(
        update={"devices": {**config.devices, "headset": headset}, "display": display}
    )


class FewTrials(StudyExperiment):
    """The first trial of the first two blocks."""

    def plan(self, participant_index: int, seed: int, group: str = "") -> SessionPlan:
        """Return the beginning of what the participant would do."""
        plan = super().plan(participant_index, seed, group)
        return replace(plan, blocks=tuple(replace(b, trials=b.trials[:1]) for b in plan.blocks[:2]))


class Wearer(UnattendedOperator):
    """Puts Monado's head where the simulated participant's is, in every frame."""

    status_period_ns = 1

    def __init__(self, happens: str) -> None:
        super().__init__()
        self.participant: Any = None
        self._remote: Remote | None = Remote()
        self._happens = happens
        self._back_ns = 0

    def poll(self) -> Sequence[Command]:
        """Move the head; start the service again where it was killed."""
        if self._back_ns and CLOCK.now_ns() >= self._back_ns:
            self._back_ns = 0
            call("start")
            self._remote = Remote()
        if self._remote is not None:
            position_m, (w, x, y, z) = self.participant.head(CLOCK.now_ns())
            self._remote.put_head(tuple(position_m), (x, y, z, w))
        return ()

    def show(self, status: SessionStatus) -> None:
        """Let happen in the first trial what is to happen."""
        if status.state is not SessionState.TRIAL or self._remote is None:
            return
        happens, self._happens = self._happens, ""
        if happens == "knob":
            self._remote.put_eyes(0.070)
        elif happens == "kill":
            self._remote.close()
            self._remote = None
            call("kill")
            self._back_ns = CLOCK.now_ns() + AWAY_NS


def whole_request(study: OpenedStudy, data_root: Path, *, shows: bool, happens: str) -> Request:
    """Return a short session of a study from its beginning to its end, on Monado."""
    config = lab(data_root)
    quick = {"answer_limit_s": 1.0} if study.name == "waving" else {}
    experiment = FewTrials(study.study, {**small(study.name), **quick})
    example = load_config(EXAMPLE).devices
    further = {r: example[r] for r in experiment.needed_roles if r not in config.devices}
    config = config.model_copy(update={"devices": {**config.devices, **further}})
    wearer = Wearer(happens)

    def participant(*args: Any, **settings: Any) -> Any:
        made = OpenedStudy.participant(study, *args, **settings)
        wearer.participant = wearer.participant or made  # the rehearsal's comes after
        return made

    object.__setattr__(study, "participant", participant)
    made = simulated_request(
        study,
        experiment,
        on_monado(config, shows=shows),
        label="S01",
        index=0,
        seed=SEED,
        group=experiment.plan(0, SEED).group,
    )
    return replace(made, clock=CLOCK, timing=TIMING, operator=wearer)


def whole(reference: str, *, shows: bool = False, happens: str = "") -> dict[str, Any]:
    """Perform a session to its end; return what `visavis check` says of it."""
    data_root = Path(os.environ["XDG_CONFIG_HOME"]) / "whole"
    made = whole_request(find_study(reference), data_root, shows=shows, happens=happens)
    recording = Recording(perform_new(made))
    check = check_session(recording)
    head = recording.stream_arrays("head_measured")
    views = recording.stream_arrays("drawn_views") if shows else {"offset_m": np.empty((0, 2, 3))}
    apart_mm = 1000 * np.diff(views["offset_m"][:, :, 0], axis=1).ravel()
    return {
        "status": recording.status,
        "level": check.level.name,
        "findings": [f"{f.level.name}: {f.subject}: {f.message}" for f in check.findings],
        "attempts": int((recording.events()["name"] == "trial_start").sum()),
        "trials": len(check.trials),
        "apart_mm": apart_mm.tolist(),
        "shown": int((recording.stream_arrays("frame_timing")["t_submitted_ns"] >= 0).sum()),
        "tracked": float(head["valid"].mean()),
        "moved_m": float(np.ptp(head["position_m"], axis=0).max()),
    }


WHOLE = {
    **{name: partial(whole, name) for name in ("stare", "crowd", "waving")},
    "own": partial(whole, OWN),
    "own-shown": partial(whole, OWN, shows=True, happens="knob"),
    "own-killed": partial(whole, OWN, happens="kill"),
}
"""Sessions by name: the shipped studies and one of somebody's own, undisturbed and disturbed."""

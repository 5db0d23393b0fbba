"""A short path through the stare study: the same people, trials and rules without the engine.

It leaves out wires, drivers, recorder, session, calibration and validation, and agents' blinks;
everything that decides a measure is the code the engine uses: the participant, the audience, the
ray test, the area of interest, the look measures, and a tracker model handed in. A trial takes
about 2 ms instead of 200, which makes fitting, power analyses and studies of the null
hypothesis feasible. Head position is held for a tenth of a second at a time in the ray test
(it moves less than a millimetre meanwhile).
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.analysis.gaze.aoi import aoi_of_samples
from visavis.analysis.gaze.looks import LookMeasures, measure_trial
from visavis.experiments.stare.design import (
    AVERTED,
    AVERTED_THEN_DIRECTED,
    DYNAMIC_CONDITIONS,
    MAX_AGENTS,
    StareParameters,
)
from visavis.experiments.stare.scene import active_index_of
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.geometry import rotate
from visavis.people.observer import Observer
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.stimuli.gaze.behaviour import EyeBehaviour
from visavis.stimuli.gaze.blinks import Blinks
from visavis.stimuli.scene import Scene, SceneFrame
from visavis.stimuli.scenes.audience import (
    PARTICIPANT_EYE_M,
    SPEAKER_EYE_M,
    audience_scene,
    black_scene,
)
from visavis.stimuli.visibility import SceneGeometry
from visavis.study.look_measures import MAIN_MEASURES
from visavis.study.study_functions import TrackerModel

FIRST_FRAME = 2
"""The dark appears two frames after the stretch begins: one to wait for, one to be displayed."""
DISPLAY_HZ = 90
TRACKER_HZ = 120
HELD_SAMPLES = 12
CHUNK_SAMPLES = 240

Times = npt.NDArray[np.int64]


@lru_cache(maxsize=MAX_AGENTS)
def _scenes(agents: int) -> tuple[Scene, Scene, SceneGeometry, EyeBehaviour]:
    characters = tuple(f"character_{i + 1:02d}" for i in range(agents))
    scene = audience_scene(characters)
    nothing = np.empty(0, np.int64)
    behaviour = EyeBehaviour.of_scene(
        scene, target_m=SPEAKER_EYE_M, blinks=Blinks(nothing, nothing, nothing)
    )
    return scene, black_scene(characters), SceneGeometry.from_scene(scene), behaviour


def _frame_at_or_after(t_ns: int) -> int:
    return -(-t_ns * DISPLAY_HZ // NS_PER_S)


def _frame_ns(index: int) -> int:
    return index * NS_PER_S // DISPLAY_HZ


def _sample_times(start_ns: int, end_ns: int) -> Times:
    first = -(-start_ns * TRACKER_HZ // NS_PER_S)
    last = -(-end_ns * TRACKER_HZ // NS_PER_S)
    return np.arange(first, last, dtype=np.int64) * NS_PER_S // TRACKER_HZ


def quick_trials(
    participant: Observer, tracker: TrackerModel, plan: SessionPlan, *, params: StareParameters
) -> Iterator[tuple[Trial, dict[str, Any]]]:
    """Perform every trial of a plan but practice; yield its measures and its gaze change.

    The gaze change is in milliseconds from the trial's start, None without one.
    """
    for block in plan.blocks:
        participant.wear(block.index + 1)
        for trial in (t for t in block.trials if not t.is_practice):
            looks, switch_ms = _trial(participant, tracker, trial, params)
            columns = looks.as_row()
            names = (*MAIN_MEASURES, "lost_01")
            yield trial, {n: columns[n] for n in names} | {"switch_ms": switch_ms}


def _trial(
    participant: Observer,
    tracker: TrackerModel,
    trial: Trial,
    params: StareParameters,
) -> tuple[LookMeasures, float | None]:
    scene, _, geometry, behaviour = _scenes(params.agents)
    active = active_index_of(trial)
    condition = str(trial.factors["condition"])
    if condition not in (AVERTED, AVERTED_THEN_DIRECTED):
        behaviour = behaviour.staring(active)
    start_frame = FIRST_FRAME + 1 + _frame_at_or_after(round(params.intertrial_s * NS_PER_S))
    start_ns = _frame_ns(start_frame)
    end_ns = start_ns + round(params.trial_s * NS_PER_S)
    t_ns = _sample_times(start_ns, end_ns)
    first = int(t_ns[0] * TRACKER_HZ // NS_PER_S) + 1
    _begin(participant, trial.number, start_ns, params.agents, behaviour)

    def aoi_of_part(part: slice) -> npt.NDArray[np.int16]:
        return _aoi(participant, tracker, geometry, t_ns[part], first + part.start, params.pad_deg)

    n = t_ns.shape[0]
    if condition not in DYNAMIC_CONDITIONS:
        aoi = aoi_of_part(slice(0, n))
        return measure_trial(t_ns, aoi, active, start_ns, end_ns), None

    # The change does not affect a participant who does not notice contact: one pass is enough.
    step = CHUNK_SAMPLES if participant.notices_contact else n
    aoi = np.empty(0, np.int16)
    while aoi.size < n and not (aoi == active).any():
        aoi = np.concatenate([aoi, aoi_of_part(slice(aoi.size, min(aoi.size + step, n)))])
    turn_frame = _turn_frame(t_ns, aoi, active, start_ns, tracker.delay_ns, params)
    switch_ns = _frame_ns(turn_frame + 1)
    # Samples beyond the change were simulated without it: go back and simulate them again.
    after = int(np.searchsorted(t_ns, switch_ns))
    n_valid = min(aoi.size, after)
    if participant.notices_contact:
        turning = behaviour.turning(
            active,
            _frame_ns(turn_frame) - start_ns,
            to_observer=condition == AVERTED_THEN_DIRECTED,
        )
        _begin(participant, trial.number, start_ns, params.agents, behaviour)
        participant.head(int(t_ns[n_valid - 1]))
        between = aoi_of_part(slice(n_valid, after)) if n_valid < after else aoi[:0]
        moving = True
        while moving:
            moving = _show(participant, scene, turning, start_ns, turn_frame)
            turn_frame += 1
        aoi = np.concatenate([aoi[:n_valid], between, aoi_of_part(slice(after, n))])
    looks = measure_trial(t_ns, aoi, active, start_ns, end_ns, switch_ns=switch_ns)
    return looks, (switch_ns - start_ns) / NS_PER_MS


def _begin(
    participant: Observer, stretch: int, start_ns: int, agents: int, behaviour: EyeBehaviour
) -> None:
    """Go through the dark before a trial and show its first picture."""
    scene, dark, _, _ = _scenes(agents)
    facing = np.array([a.facing for a in dark.agents])
    participant.prepare(stretch, 0)
    dark_ns = _frame_ns(FIRST_FRAME)
    participant.see(SceneFrame(dark, dark_ns, facing, np.ones(agents)), dark_ns)
    gaze, openness, _ = behaviour.at(0, PARTICIPANT_EYE_M)
    participant.head(start_ns - 1)
    participant.see(SceneFrame(scene, start_ns, gaze, openness), start_ns)


def _show(
    participant: Observer, scene: Scene, behaviour: EyeBehaviour, start_ns: int, frame: int
) -> bool:
    """Show what a frame holds, from the next on; tell whether eyes move."""
    elapsed_ns = _frame_ns(frame) - start_ns
    display_ns = _frame_ns(frame + 1)
    gaze, openness, moving = behaviour.at(elapsed_ns, PARTICIPANT_EYE_M)
    participant.see(SceneFrame(scene, display_ns, gaze, openness), display_ns)
    return moving


def _aoi(
    participant: Observer,
    tracker: TrackerModel,
    geometry: SceneGeometry,
    t_ns: Times,
    first_sample: int,
    pad_deg: float,
) -> npt.NDArray[np.int16]:
    """Return the area of interest of each sample, as the tracker sees it."""
    eyes, position, orientation = participant.sense(t_ns)
    direction_head, valid = tracker.measure(
        eyes, first_sample=first_sample, stretch=participant.stretch(), fit=participant.fit()
    )
    head_sample = np.arange(t_ns.shape[0]) // HELD_SAMPLES * HELD_SAMPLES
    origin = position[head_sample]
    direction = rotate(orientation, direction_head)
    angle, radius, limit, hit = geometry.observe(origin, direction, valid)
    return aoi_of_samples(angle, radius, limit, hit, pad_deg=pad_deg)


def _turn_frame(
    t_ns: Times,
    aoi: npt.NDArray[np.int16],
    active: int,
    start_ns: int,
    delay_ns: int,
    params: StareParameters,
) -> int:
    """Return the frame at which the active agent turns: once looked at, or at half time."""
    limit_ns = start_ns + round(params.trial_s * params.switch_at_01 * NS_PER_S)
    by_time = _frame_at_or_after(limit_ns)
    on = np.flatnonzero(aoi == active)
    if not on.size:
        return by_time
    seen_ns = int(t_ns[on[0]]) + delay_ns
    wait_ns = round(params.look_trigger_ms * NS_PER_MS)
    return min(by_time, _frame_at_or_after(max(seen_ns, int(t_ns[on[0]]) + wait_ns)))

"""When in a walk somebody looked at people of the crowd."""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from visavis.analysis.gaze.targets import GazeTargets, gaze_of_part
from visavis.experiments.crowd.walks import Walk
from visavis.lab.clock import NS_PER_MS
from visavis.protocol.plan.steps import Scalar
from visavis.recording.reader import Recording
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.scenes.station_crowd import Crowd, CrowdScene, station_frame
from visavis.stimuli.surfaces import Surfaces
from visavis.study.look_course import STEP_MS, shares_in_steps

LIGHTEST: Final = 9
"""People are met at their lightest level, as the viewer and gaze maps draw many."""


def looks_of(recording: Recording, walk: Walk) -> list[dict[str, Any]]:
    """Return the share of usable gaze on people in steps of a walk; nothing without gaze."""
    if "gaze_targets" not in recording.stream_names:
        return []
    samples = gaze_of_part(recording, int(walk.row["recording_part"])).targets
    span_ns = int(walk.row["t_start_ns"]), int(walk.row["t_end_ns"])
    key = {name: walk.row[name] for name in ("session", "attempt")}
    return [{**key, **step} for step in shares_on_people(samples, walk.crowd, span_ns)]


def shares_on_people(
    samples: GazeTargets, crowd: Crowd, span_ns: tuple[int, int]
) -> Iterator[dict[str, Scalar | None]]:
    """Yield the steps of a walk that lasted from and to, as `look_course` does.

    Rays end on people, board, walls and floor as they are drawn. Everybody stands as in the middle
    of the step. Where the rays begin must be known.
    """
    start_ns, end_ns = span_ns
    is_inside = (samples.t_ns >= start_ns) & (samples.t_ns < end_ns)
    samples = samples.rows(np.flatnonzero(samples.valid & is_inside))
    if samples.origin_world_m is None:
        return
    since_ns, step_ns = samples.t_ns - start_ns, STEP_MS * NS_PER_MS
    step, is_on = since_ns // step_ns, np.zeros(len(since_ns), np.bool_)
    scene = CrowdScene(f"station_{crowd.configuration}", agents=(), crowd=crowd)
    surfaces = Surfaces(LIGHTEST)
    for k in np.unique(step).tolist():
        here, middle_ns = step == k, k * step_ns + step_ns // 2
        picture = picture_of(station_frame(scene, start_ns + middle_ns, middle_ns))
        direction = samples.direction_world[here].astype(np.float64)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        ends = surfaces.ends(picture, samples.origin_world_m[here].astype(np.float64), direction)
        is_on[here] = np.isin(ends.name, [character.name for character in picture.cast])
    yield from shares_in_steps(since_ns, is_on, end_ns - start_ns)

"""One walk of the crowd study, frame by frame: contacts answered, the board lit, the way back.

Times of a row count from the first frame after the crowd came on. People move as a pure function
of the time since then and of their seeds, both recorded, so every pose can be rebuilt.
"""

import json
from collections.abc import Generator
from functools import cache
from typing import Final

import numpy as np

from visavis.experiments.crowd.design import CrowdParameters
from visavis.experiments.crowd.haptics import BandOrder
from visavis.experiments.crowd.reflex import ContactReflex
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.protocol.plan.session_plan import Trial
from visavis.protocol.plan.steps import (
    Ask,
    AskReply,
    FrameView,
    Mark,
    Plan,
    Reflex,
    Row,
    Scalar,
    Show,
    Silence,
    Step,
    TrialInterrupted,
)
from visavis.stimuli.scenes.station_crowd import (
    DENSITY_PER_M2,
    START_M,
    Crowd,
    CrowdScene,
    can_read,
    station_crowd,
    station_frame,
)
from visavis.study.asking import frame

TRACKS: Final = tuple(str(number) for number in range(1, 13))


def track_of(trial: Trial) -> str:
    """Return the track number the board shows in a trial."""
    return TRACKS[int(trial.rng(0).integers(len(TRACKS)))]


@cache
def laid_out(configuration: int, density: float = DENSITY_PER_M2) -> Crowd:
    """Return a crowd of the study; laying one out takes longer than a frame, so only once."""
    return station_crowd(configuration, density)


def crowd_scene(trial: Trial, density: float = DENSITY_PER_M2) -> tuple[Crowd, CrowdScene]:
    """Return the crowd of a trial and the scene that shows it."""
    configuration = int(trial.factors["configuration"])
    crowd = laid_out(configuration, density)
    return crowd, CrowdScene(f"station_{configuration}", agents=(), crowd=crowd)


def crowd_record(crowd: Crowd) -> str:
    """Return everything that places a crowd's people at any time, as JSON."""
    return json.dumps(
        {
            "position_m": crowd.position_m.tolist(),
            "yaw_rad": crowd.yaw_rad.tolist(),
            "stature_m": crowd.stature_m.tolist(),
            "behaviour": crowd.behaviour.tolist(),
            "character": crowd.character.tolist(),
            "outfit": crowd.outfit.tolist(),
            "seed": crowd.seed.tolist(),
        }
    )


def run_trial(
    trial: Trial,
    params: CrowdParameters,
    moved_segments: set[tuple[str, int]] | None = None,
    *,
    question: str = "track",
) -> Plan:
    """Perform a walk there and back; whatever happens, the bands end silent.

    `moved_segments` is the session's memory of segments that moved; see `ContactReflex`. `question`
    is put to the operator at the end.
    """
    try:
        row = yield from _walk(trial, params, moved_segments)
    except TrialInterrupted:
        yield Reflex(None)
        yield Silence()
        raise
    yield Silence()
    reply = yield Ask("track", question, TRACKS)
    answer = reply.answer if isinstance(reply, AskReply) else None
    return {**row, "track_read": answer, "track_right": answer == row["track"]}


def _walk(
    trial: Trial, params: CrowdParameters, moved_segments: set[tuple[str, int]] | None
) -> Generator[Step, FrameView | AskReply | None, Row]:
    crowd, scene = crowd_scene(trial, params.density_per_m2)
    track = track_of(trial)
    vibrates = bool(trial.factors["vibrates"])
    view = yield from frame()
    yield Mark("crowd", {"trial_id": trial.trial_id, "people": crowd_record(crowd)})
    yield Show(station_frame(scene, view.t_ns))
    view = yield from frame()
    start_ns = view.t_ns
    yield Mark("scene_on", {"trial_id": trial.trial_id, "scene_name": scene.name})
    limit_ns = start_ns + round(params.limit_s * NS_PER_S)
    quiet_ns = round(params.quiet_after_ms * NS_PER_MS)
    contacts = ContactReflex(
        crowd, start_ns, quiet_ns, params, vibrates=vibrates, moved_segments=moved_segments
    )
    yield Reflex(contacts.answer)
    board_ns: int | None = None
    n_contacts = frames = 0
    while True:
        frames += 1
        now_ns = view.t_ns
        for step in contacts.look_after(now_ns):
            yield step
        for order in contacts.take_orders():
            n_contacts += order.kind == "begin"
            yield Mark(f"contact_{order.kind}", _contact_row(trial, order, vibrates))
        x, _, z = view.head.position_m.tolist()
        reads = can_read(x, z) and view.head_valid
        if reads and board_ns is None:
            board_ns = now_ns
            yield Mark("board_on", {"trial_id": trial.trial_id, "track": track})
        home_m = float(np.hypot(x - START_M[0], z - START_M[1]))
        came_back = board_ns is not None and home_m <= params.home_within_m and view.head_valid
        if came_back or now_ns >= limit_ns:
            break
        yield Show(station_frame(scene, now_ns, now_ns - start_ns, track if reads else None))
        view = yield from frame()
    yield Reflex(None)
    for step in contacts.end(view.t_ns):
        yield step
    for order in contacts.take_orders():
        n_contacts += order.kind == "begin"
        yield Mark(f"contact_{order.kind}", _contact_row(trial, order, vibrates))
    columns, flags = contacts.account()
    if not came_back:
        flags.append("not_back_in_time")
    return {
        "t_start_ns": start_ns,
        "t_end_ns": view.t_ns,
        "board_ns": board_ns,
        "came_back": came_back,
        "track": track,
        "contacts_online": n_contacts,
        "scene_frames": frames,
        **columns,
        "walk_flags": ";".join(flags),
    }


def _contact_row(trial: Trial, order: BandOrder, vibrates: bool) -> dict[str, Scalar | None]:
    return {
        "trial_id": trial.trial_id,
        "role": order.role,
        "t_contact_ns": order.t_contact_ns,
        "vibrates": vibrates,
        "segment": order.segment or None,
        "person": None if order.person < 0 else order.person,
        "depth_m": None if order.person < 0 else round(order.depth_m, 6),
        "motors": " ".join(map(str, order.motors)) or None,
    }

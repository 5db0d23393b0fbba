"""One walk of the crowd study, frame by frame: contacts answered, the board lit, the way back.

Times of a row count from the first frame after the crowd came on. People move as a pure function
of the time since then and of their seeds, both recorded, so every pose can be rebuilt.
"""

import json
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from experiments.crowd.design import CrowdParameters
from experiments.crowd.haptics import BandOrder, ContactAnswer
from lab.clock import NS_PER_MS, NS_PER_S
from lab.geometry import Vector
from protocol.plan import Trial
from protocol.steps import (
    Answered,
    Ask,
    BodyView,
    FrameView,
    Mark,
    NextFrame,
    Plan,
    Play,
    Row,
    Scalar,
    Show,
    Silence,
    Step,
    TrialInterrupted,
)
from stimuli.contact.body import ARM_JOINTS
from stimuli.scenes.station_crowd import (
    EMPTY_STATION,
    START_M,
    Crowd,
    CrowdFrame,
    CrowdScene,
    can_read,
    in_room,
    station_crowd,
)

Frames: TypeAlias = Generator[Step, FrameView | Answered | None, FrameView]
TRACKS: Final = tuple(str(number) for number in range(1, 13))

_NEXT = NextFrame()
_NO_GAZE = np.empty((0, 3))
_NO_EYES = np.empty(0)


@dataclass
class _Tracking:
    """What went wrong with the body's tracking in a trial, in ns of lost time."""

    last_ns: int
    silent_ns: int = 0
    part_lost_samples: int = 0
    frozen_ns: int = 0
    outside_samples: int = 0
    samples: int = 0
    still_since_ns: int = 0
    last_place: Vector = field(default_factory=lambda: np.zeros(3))

    def flags(self) -> list[str]:
        """Name what an analyst must know."""
        found = []
        if self.samples == 0:
            found.append("body_never_tracked")
        elif self.silent_ns:
            found.append("body_silent")
        if self.part_lost_samples:
            found.append("body_part_lost")
        if self.frozen_ns:
            found.append("body_frozen")
        if self.outside_samples:
            found.append("left_room")
        return found


def track_of(trial: Trial) -> str:
    """Return the track number the board shows in a trial."""
    rng = np.random.default_rng(np.random.SeedSequence(trial.seed, spawn_key=(0,)))
    return TRACKS[int(rng.integers(len(TRACKS)))]


def crowd_scene(trial: Trial) -> tuple[Crowd, CrowdScene]:
    """Return the crowd of a trial and the scene that shows it."""
    configuration = int(trial.factors["configuration"])
    crowd = station_crowd(configuration)
    return crowd, CrowdScene(f"station_{configuration}", agents=(), crowd=crowd)


def crowd_record(crowd: Crowd) -> str:
    """Return everything that places a crowd's people at any time, as JSON."""
    return json.dumps(
        {
            "position_m": np.round(crowd.position_m, 9).tolist(),
            "yaw_rad": crowd.yaw_rad.tolist(),
            "stature_m": crowd.stature_m.tolist(),
            "behaviour": crowd.behaviour.tolist(),
            "character": crowd.character.tolist(),
            "seed": crowd.seed.tolist(),
        }
    )


def run_trial(trial: Trial, params: CrowdParameters) -> Plan:
    """Perform a walk there and back; whatever happens, the bands end silent."""
    try:
        row = yield from _walk(trial, params)
    except TrialInterrupted:
        yield Silence()
        raise
    yield Silence()
    reply = yield Ask("track", "Which track number did the participant read aloud?", TRACKS)
    answer = reply.answer if isinstance(reply, Answered) else None
    return {**row, "track_read": answer, "track_right": answer == row["track"]}


def _walk(
    trial: Trial, params: CrowdParameters
) -> Generator[Step, FrameView | Answered | None, Row]:
    crowd, scene = crowd_scene(trial)
    track = track_of(trial)
    vibrates = bool(trial.factors["vibrates"])
    view = yield from _frame()
    yield Mark("crowd", {"trial_id": trial.trial_id, "people": crowd_record(crowd)})
    yield Show(CrowdFrame(scene, view.t_ns, _NO_GAZE, _NO_EYES))
    view = yield from _frame()
    start_ns = view.t_ns
    yield Mark("scene_on", {"trial_id": trial.trial_id, "scene_name": scene.name})
    limit_ns = start_ns + round(params.limit_s * NS_PER_S)
    quiet_ns = round(params.quiet_after_ms * NS_PER_MS)
    tracking = _Tracking(start_ns, still_since_ns=start_ns)
    contacts: ContactAnswer | None = None
    board_ns: int | None = None
    begun = frames = 0
    while True:
        frames += 1
        now_ns = view.t_ns
        if view.body is not None:
            if contacts is None:
                contacts = ContactAnswer(
                    crowd,
                    view.body.segments,
                    params.vibration,
                    nearest_motor=params.nearest_motor,
                    update_hz=params.haptic_update_hz,
                )
                contacts.fit(view.body.position_m[0])
            orders = _answers(contacts, tracking, view.body, start_ns, quiet_ns)
        elif contacts is not None and now_ns - tracking.last_ns > quiet_ns:
            orders = contacts.silence(now_ns)
        else:
            orders = []
        for order in orders:
            begun += order.kind == "begin"
            yield Mark(f"contact_{order.kind}", _contact_row(trial, order, vibrates))
            if vibrates:
                yield _step_of(order, params)
        x, _, z = view.head.position_m.tolist()
        reads = can_read(x, z) and view.head_valid
        if reads and board_ns is None:
            board_ns = now_ns
            yield Mark("board_on", {"trial_id": trial.trial_id, "track": track})
        home_m = float(np.hypot(x - START_M[0], z - START_M[1]))
        came_back = board_ns is not None and home_m <= params.home_within_m and view.head_valid
        if came_back or now_ns >= limit_ns:
            break
        yield Show(
            CrowdFrame(
                scene,
                now_ns,
                _NO_GAZE,
                _NO_EYES,
                crowd_t_ns=now_ns - start_ns,
                track=track if reads else None,
            )
        )
        view = yield from _frame()
    if contacts is not None:
        for order in contacts.silence(view.t_ns):
            yield Mark("contact_end", _contact_row(trial, order, vibrates))
            if vibrates:
                yield _step_of(order, params)
    if tracking.samples and view.t_ns - tracking.last_ns > quiet_ns:
        tracking.silent_ns += view.t_ns - tracking.last_ns
    flags = tracking.flags()
    if not came_back:
        flags.append("not_back_in_time")
    return {
        "t_start_ns": start_ns,
        "t_end_ns": view.t_ns,
        "board_ns": board_ns,
        "came_back": came_back,
        "track": track,
        "contacts_online": begun,
        "scene_frames": frames,
        "body_samples": tracking.samples,
        "body_silent_ms": tracking.silent_ns / NS_PER_MS,
        "body_frozen_ms": tracking.frozen_ns / NS_PER_MS,
        "body_part_lost_samples": tracking.part_lost_samples,
        "outside_room_samples": tracking.outside_samples,
        "walk_flags": ";".join(flags),
    }


def _frame() -> Frames:
    view = yield _NEXT
    if not isinstance(view, FrameView):
        raise TypeError(f"a plan that asked for a frame was sent {view!r}")
    return view


def _answers(
    contacts: ContactAnswer, tracking: _Tracking, body: BodyView, start_ns: int, quiet_ns: int
) -> list[BandOrder]:
    """Compare every sample with the crowd; note what is odd about the tracking."""
    orders: list[BandOrder] = []
    arms = [body.segments.index(name) for name in ARM_JOINTS]
    hips = body.segments.index("hips")
    for i, t_ns in enumerate(body.t_ns.tolist()):
        if t_ns < start_ns:
            continue
        gap_ns = t_ns - tracking.last_ns
        if gap_ns > quiet_ns:
            tracking.silent_ns += gap_ns
        tracking.samples += 1
        hands = body.position_m[i, arms]
        place = hands.sum(axis=0)
        if np.array_equal(place, tracking.last_place):
            if t_ns - tracking.still_since_ns > quiet_ns:
                tracking.frozen_ns += gap_ns
                orders += contacts.silence(t_ns)
                tracking.last_ns = t_ns
                continue
        else:
            tracking.still_since_ns, tracking.last_place = t_ns, place
        tracking.last_ns = t_ns
        if not body.valid[i].all():
            tracking.part_lost_samples += 1
        at = body.position_m[i, hips]
        if np.isfinite(at).all() and not in_room(at[[0, 2]]):
            tracking.outside_samples += 1
        orders += contacts.sample(
            t_ns, (t_ns - start_ns) / NS_PER_S, body.position_m[i], body.orientation_wxyz[i]
        )
    return orders


def _step_of(order: BandOrder, params: CrowdParameters) -> Step:
    if order.kind == "end":
        return Silence(order.role)
    return Play(order.role, params.vibration, order.motors)


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


def intertrial(trial: Trial, params: CrowdParameters) -> Plan:
    """Stand on the mark in the empty station before a walk, for `intertrial_s`."""
    view = yield from _frame()
    start_ns = view.t_ns
    yield Show(CrowdFrame(EMPTY_STATION, start_ns, _NO_GAZE, _NO_EYES))
    until_ns = start_ns + round(params.intertrial_s * NS_PER_S)
    while view.t_ns < until_ns:
        view = yield from _frame()
    return {"intertrial_ms": (view.t_ns - start_ns) / NS_PER_MS}

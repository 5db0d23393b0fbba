"""Rebuild a walk from its recording: the participant's joints and everybody's pose at any time."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.gait import resample
from visavis.devices.segment_watch import SegmentWatch
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import Vector
from visavis.recording.integrity import analysed_trials
from visavis.recording.reader import Recording
from visavis.stimuli.contact.body import REFERENCE_STATURE_M
from visavis.stimuli.contact.idle import people_of
from visavis.stimuli.scenes.station_crowd import Crowd

STEP_NS: Final = 10 * NS_PER_MS
"""Walks are measured every 10 ms, as published; poses in between are interpolated."""

_ARM_OF_STATURE: Final = 0.332
"""Upper arm and forearm together as a share of stature (Winter 2009)."""


@dataclass(frozen=True, eq=False)
class Walk:
    """One recorded walk, resampled every 10 ms.

    `t_ns` (n,); `position_m` (n, 22, 3) and `orientation_wxyz` (n, 22, 4) of `BODY_JOINTS` in
    world, NaN where a joint was lost; `stature_m` of the body as its arms tell; `row` is the
    trial's recorded row. `crowd_t_s` (n,) is the time of the people's motion. `frozen_ns` is how
    long a segment repeated its last pose while the body moved; it is missing in that time.
    """

    trial_id: str
    row: Mapping[str, Any]
    crowd: Crowd
    t_ns: npt.NDArray[np.int64]
    position_m: Vector
    orientation_wxyz: Vector
    stature_m: float
    frozen_ns: Mapping[str, int] = field(default_factory=dict)

    @property
    def crowd_t_s(self) -> Vector:
        """Seconds since the crowd came on."""
        since: Vector = (self.t_ns - int(self.row["t_start_ns"])) / NS_PER_S
        return since

    @property
    def people(self) -> Vector:
        """Rows (people, 15) for `visavis.stimuli.contact.idle`."""
        return people_of(self.crowd)

    def steps_at(self, rate_hz: float, seconds: float = np.inf) -> npt.NDArray[np.int64]:
        """Return the steps nearest to so many moments a second, at most for so long."""
        since_s = self.crowd_t_s
        length_s = min(float(since_s[-1] - since_s[0]), seconds)
        times = since_s[0] + np.arange(0.0, length_s + 1e-9, 1 / rate_hz)
        steps: npt.NDArray[np.int64] = np.clip(
            np.searchsorted(since_s, times - 1e-6), 0, len(since_s) - 1
        )
        return steps

    def joint(self, name: str) -> Vector:
        """Return the positions (n, 3) of a joint."""
        at: Vector = self.position_m[:, BODY_JOINTS.index(name)]
        return at

    @property
    def place_m(self) -> Vector:
        """Where the participant is on the floor, (n, 2) x and z of the hips."""
        at: Vector = self.joint("hips")[:, [0, 2]]
        return at


def crowd_from_record(configuration: int, people: str) -> Crowd:
    """Return the crowd of a recorded event "crowd"."""
    raw = json.loads(people)
    return Crowd(
        configuration=configuration,
        position_m=np.array(raw["position_m"], float),
        yaw_rad=np.array(raw["yaw_rad"], float),
        stature_m=np.array(raw["stature_m"], float),
        behaviour=np.array(raw["behaviour"], np.int64),
        character=np.array(raw["character"], np.int64),
        seed=np.array(raw["seed"], np.int64),
        # Before there were outfits everybody stood as they came.
        outfit=np.array(raw.get("outfit", np.zeros(len(raw["seed"]))), np.int64),
    )


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """The record of one finished walk in a session, before its body stream is read."""

    row: Mapping[str, Any]
    crowd: Crowd

    @property
    def trial_id(self) -> str:
        """The trial's identifier."""
        return str(self.row["trial_id"])


def walk_records(
    recording: Recording, *, practice: bool = False, intact: bool = False
) -> list[WalkRecord]:
    """Return every complete walk of a session in order of performance, with or without training.

    With `intact`, every file is verified and walks that lost samples are left out.

    Raises:
        DataError: the crowd of a walk was not recorded.
    """
    trials = analysed_trials(recording) if intact else recording.trials()
    if trials.empty:
        return []
    events = recording.events()
    people: dict[tuple[int, str], str] = {}
    for event in events[events["name"] == "crowd"].to_dict("records"):
        people[event["recording_part"], event["payload"]["trial_id"]] = event["payload"]["people"]
    records = []
    for row in trials[trials["status"] == "complete"].to_dict("records"):
        if (row["is_practice"] and not practice) or row.get("t_end_ns") is None:
            continue
        key = (int(row["recording_part"]), str(row["trial_id"]))
        if key not in people:
            raise DataError(
                f"{recording.path}: trial {key[1]} has no event 'crowd'; it was not recorded by "
                "this study, leave the session out"
            )
        crowd = crowd_from_record(int(row["configuration"]), people[key])
        records.append(WalkRecord({str(k): v for k, v in row.items()}, crowd))
    return records


def walks(recording: Recording, *, step_ns: int = STEP_NS) -> list[Walk]:
    """Return every intact walk of a session, training left out, in order of performance.

    Raises:
        DataError: the crowd of a walk was not recorded, or the body tracker lacks joints.
    """
    records = walk_records(recording, intact=True)
    return [load_walk(recording, record, step_ns=step_ns) for record in records]


def walk_of(recording: Recording, trial_id: str, *, step_ns: int = STEP_NS) -> Walk:
    """Return one complete walk of a session, training included.

    Raises:
        UsageError: there is no such walk; the message names those there are.
        DataError: as `walks`.
    """
    records = walk_records(recording, practice=True)
    for record in reversed(records):  # the last attempt of a repeated walk
        if record.trial_id == trial_id:
            return load_walk(recording, record, step_ns=step_ns)
    names = ", ".join(r.trial_id for r in records) or "none"
    raise UsageError(
        f"{recording.path} holds no finished walk {trial_id!r}; finished walks: {names}"
    )


def load_walk(recording: Recording, record: WalkRecord, *, step_ns: int = STEP_NS) -> Walk:
    """Return a walk with the participant's body at every step.

    Raises:
        DataError: the body tracker lacks joints, or recorded nothing that can be read.
    """
    row, crowd = record.row, record.crowd
    start_ns, end_ns = int(row["t_start_ns"]), int(row["t_end_ns"])
    part = int(row["recording_part"])
    arrays = recording.stream_arrays(
        "body", part=part, t_start_ns=start_ns - NS_PER_S, t_end_ns=end_ns + NS_PER_S
    )
    order = joint_columns(recording)
    t_ns = arrays["t_host_ns"]
    keep = later_than_all_before(t_ns)
    t_ns = t_ns[keep]
    valid = arrays["valid"][keep][:, order]
    position = arrays["position_m"][keep][:, order].astype(np.float64)
    turn = arrays["orientation_wxyz"][keep][:, order].astype(np.float64)
    position[~valid], turn[~valid] = np.nan, np.nan
    is_still = standing_still(t_ns, position)
    parts = frozen_parts(t_ns, position, turn, row.get("frozen_segments"))
    parts[is_still] = False
    position[is_still], turn[is_still] = np.nan, np.nan
    position[parts], turn[parts] = np.nan, np.nan
    within = (t_ns >= start_ns) & (t_ns < end_ns)
    grid = steps_within(start_ns, end_ns, step_ns, t_ns)
    at, orientation = resample(t_ns, position, turn, grid)
    stature_m = stature_of_arms(position)
    frozen_ns = durations_ns(t_ns, parts & within[:, None])
    return Walk(str(row["trial_id"]), row, crowd, grid, at, orientation, stature_m, frozen_ns)


def steps_within(
    start_ns: int, end_ns: int, step_ns: int, t_ns: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """Return the steps of a trial that a running tracker could have seen.

    A session stops its tracker between two samples, so the last steps of its last trial may lie
    after the last sample. Those less than one usual sample interval away are not part of the walk;
    when the tracker had stopped earlier, every step stays and is missing.
    """
    grid = np.arange(start_ns, end_ns, step_ns, dtype=np.int64)
    if len(t_ns) < 2:
        return grid
    interval_ns = int(np.median(np.diff(t_ns)))
    first = int(t_ns[0]) if t_ns[0] - start_ns < interval_ns else start_ns
    last = int(t_ns[-1]) if end_ns - t_ns[-1] < interval_ns else end_ns
    return grid[(grid >= first) & (grid <= last)]


def joint_columns(recording: Recording) -> list[int]:
    """Return the column of each of `BODY_JOINTS` in the recorded body stream.

    Raises:
        DataError: the stream or a joint is missing.
    """
    schema = recording.stream_schema("body")
    if schema is None:
        raise DataError(
            f"{recording.path} holds no body stream (body.arrows) that can be read; restore it "
            "from a copy, or move the session's folder out of the study"
        )
    field = next(f for f in schema.fields if f.name == "position_m")
    names = field.description.partition(": ")[2].split()
    missing = [joint for joint in BODY_JOINTS if joint not in names]
    if missing:
        raise DataError(
            f"{recording.path}: the body tracker recorded no {', '.join(missing)}; collisions "
            "need all of them"
        )
    return [names.index(joint) for joint in BODY_JOINTS]


def later_than_all_before(t_ns: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Tell which samples are later than all before them: repeats and steps back are not."""
    latest = np.maximum.accumulate(t_ns)
    return np.concatenate([[True], t_ns[1:] > latest[:-1]]) if len(t_ns) else np.zeros(0, bool)


def standing_still(
    t_ns: npt.NDArray[np.int64], position_m: Vector, *, longest_ns: int = 150 * NS_PER_MS
) -> npt.NDArray[np.bool_]:
    """Tell which samples repeat the one before, bit for bit, for longer than a live body can.

    Joints that stay lost repeat themselves too.
    """
    n = len(t_ns)
    is_still = np.zeros(n, bool)
    if n < 2:
        return is_still
    flat = position_m.reshape(n, -1)
    before, after = flat[:-1], flat[1:]
    same = ((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(int)))
    for a, b in edges.reshape(-1, 2):
        if t_ns[b] - t_ns[a] > longest_ns:
            is_still[a + 1 : b + 1] = True
    return is_still


def frozen_parts(
    t_ns: npt.NDArray[np.int64], position_m: Vector, orientation_wxyz: Vector, seen_live: object
) -> npt.NDArray[np.bool_]:
    """Tell (n, 22) in which samples a segment of `BODY_JOINTS` repeats its last pose by itself.

    `seen_live` is what the trial's row says of frozen segments: those had moved in an earlier
    walk, though they may never do in this one.
    """
    frozen_names = {text.partition("=")[0] for text in str(seen_live or "").split(";")}
    moving_joints = frozen_names & set(BODY_JOINTS)
    is_frozen = SegmentWatch(
        BODY_JOINTS, moved_channels={(name, 0) for name in moving_joints}
    ).repeats(t_ns, position_m, orientation_wxyz)
    turning_joints = {(n, 1) for n in moving_joints if not is_frozen[:, BODY_JOINTS.index(n)].any()}
    if turning_joints:
        again = SegmentWatch(BODY_JOINTS, moved_channels=turning_joints)
        is_frozen |= again.repeats(t_ns, position_m, orientation_wxyz)
    return is_frozen


def durations_ns(t_ns: npt.NDArray[np.int64], is_frozen: npt.NDArray[np.bool_]) -> dict[str, int]:
    """Return for how long each of `BODY_JOINTS` was frozen (n, 22), those that ever were."""
    since_ns = np.diff(t_ns, prepend=t_ns[:1])
    durations = since_ns @ is_frozen
    return {name: int(ns) for name, ns in zip(BODY_JOINTS, durations.tolist(), strict=True) if ns}


def stature_of_arms(position_m: Vector) -> float:
    """Return the stature that the median length of the arms stands for; 1.75 m when unknown."""
    lengths = []
    for side in ("left", "right"):
        upper, lower, hand = (
            position_m[:, BODY_JOINTS.index(f"{side}_{part}")]
            for part in ("upper_arm", "lower_arm", "hand")
        )
        both = np.linalg.norm(lower - upper, axis=1) + np.linalg.norm(hand - lower, axis=1)
        lengths.append(both[np.isfinite(both)])
    arm_lengths = np.concatenate(lengths)
    if not arm_lengths.size:
        return REFERENCE_STATURE_M
    return float(np.clip(np.median(arm_lengths) / _ARM_OF_STATURE, 1.2, 2.2))

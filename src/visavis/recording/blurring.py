"""Blur what identifies a person in recorded motion: heights, limb lengths, trajectories.

From how head and hands move in virtual reality, one of more than 50,000 people was named at 94 %
from 100 s (Nair et al. 2023, USENIX Security); the height of the head and the lengths of the limbs
tell most. Here everybody gets the body of one reference skeleton, and movements are smoothed in
time. That takes away the static clues and the quick ones; how somebody walks through a room and
what they look at stays, and may still be recognised by who knows it: a blur is not anonymity.
"""

import re
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from visavis.lab.clock import NS_PER_S
from visavis.lab.eye_height import MAX_SEATED_EYE_M, MIN_EYE_M
from visavis.lab.geometry import Vector, rotate
from visavis.lab.schema import StreamSchema
from visavis.recording.stream_file import Columns
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward, local_of_world

STATURE_M: Final = 1.70
"""Height that everybody gets in shared data."""

STANDING_EYE_M: Final = 0.936 * STATURE_M
"""Height of the eyes of a standing person (Drillis & Contini 1966)."""

SEATED_EYE_M: Final = 1.20

SMOOTHING_S: Final = 0.2
"""Standard deviation of the Gaussian in time; above 1 Hz less than half of a movement is left."""

OUTSIDE_STEP_DEG: Final = 0.5
MAX_OUTSIDE_DEG: Final = 5.0
FAR_DEG: Final = 180.0
"""Distances of gaze from a head are given in steps of this, and left out beyond the limit."""

_RIM: Final = 1 - 1e-5

BLURRED_STREAMS: Final = ("head", "body", "gaze", "gaze_targets")
"""Kinds of streams that are blurred; see `kind_of`."""

_LENGTH = re.compile(
    r"(.*_)?(height|stature|arm|leg|limb|reach|span|ipd|eye_distance)(_off|_told)?_(m|mm)"
)


def kind_of(schema: StreamSchema) -> str | None:
    """Return how to show a stream: as one of `BLURRED_STREAMS`, "as_it_is", or None for not at all.

    An unknown stream that holds lengths or rotations may show a body and is left out; so are those
    of the session that repeat the head's poses (`pointer`, `drawn_views`).
    """
    fields = {f.name: f for f in schema.fields}
    if {"position_m", "orientation_wxyz", "valid"} == set(fields):
        return "body" if len(fields["position_m"].shape) == 2 else "head"
    if "direction_head" in fields:
        return "gaze"
    if "angle_deg" in fields and "origin_world_m" in fields:
        return "gaze_targets"
    if any(f.unit in ("m", "mm") or f.name.endswith("_wxyz") for f in schema.fields):
        return None
    return "as_it_is"


def tells_length(column: str) -> bool:
    """Tell whether a value of a trial row or an event is by its name a length of a body."""
    return _LENGTH.fullmatch(column) is not None


def smooth(values: Vector, valid: npt.NDArray[np.bool_], t_ns: npt.NDArray[np.int64]) -> Vector:
    """Return values (n, k) under a Gaussian over the valid samples; NaN where one is not valid.

    Samples count as evenly spaced by their median, which is what a tracker's are.
    """
    n = len(t_ns)
    spacing_s = float(np.median(np.diff(t_ns))) / NS_PER_S if n > 1 else 0.0
    if not spacing_s > 0:
        return np.where(valid[:, None], values, np.nan)
    sigma = SMOOTHING_S / spacing_s
    filled_values = np.where(valid[:, None], values, 0.0)
    amount = gaussian_filter1d(filled_values, sigma, axis=0, mode="constant")
    weight = gaussian_filter1d(valid.astype(np.float64), sigma, mode="constant")
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(valid[:, None], amount / weight[:, None], np.nan)


def smooth_turns(
    turns: Vector, valid: npt.NDArray[np.bool_], t_ns: npt.NDArray[np.int64]
) -> Vector:
    """Return unit quaternions (n, 4) under the same Gaussian."""
    q = np.where(valid[:, None], turns, 0.0)
    last = np.maximum.accumulate(np.where(valid, np.arange(len(q)), 0))
    before = q[np.concatenate([[0], last[:-1]])] if len(q) else q
    flips = np.where((q * before).sum(axis=1) < 0, -1.0, 1.0)
    mean = smooth(q * np.cumprod(flips)[:, None], valid, t_ns)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(mean / np.linalg.norm(mean, axis=1, keepdims=True))


def at_height(
    y_m: Vector, valid: npt.NDArray[np.bool_], median_m: float, wanted_m: float
) -> Vector:
    """Return heights stretched (or, where the floor is not 0, shifted) so that the median fits."""
    if not np.isfinite(median_m):
        return y_m
    height_m = y_m * (wanted_m / median_m) if median_m > MIN_EYE_M else y_m - median_m + wanted_m
    return np.where(valid, height_m, np.nan)


def heights_m(columns: Columns) -> Vector:
    """Return the heights of the first tracked point, of the samples that have one."""
    y_m = columns["position_m"].reshape(len(columns["t_host_ns"]), -1, 3)[:, 0, 1]
    valid = columns["valid"].reshape(len(y_m), -1)[:, 0].astype(bool)
    return np.asarray(y_m[valid], np.float64)


def segments_of(schema: StreamSchema) -> tuple[str, ...]:
    """Return the names of a body's segments, as the description of its positions lists them.

    `segment_1 …` where it lists none.
    """
    field = next(f for f in schema.fields if f.name == "position_m")
    names = field.description.rpartition(":")[2].split()
    n = field.shape[0] if len(field.shape) == 2 else 1
    if len(names) == n and all(t.isidentifier() for t in names):
        return tuple(names)
    return tuple(f"segment_{i + 1}" for i in range(n))


def has_reference(names: tuple[str, ...]) -> bool:
    """Tell whether a body's segments are those of the reference skeleton, hips among them."""
    return "hips" in names and set(names) <= set(canonical_skeleton(STATURE_M).names)


def blurred_head(columns: Columns, median_m: float) -> Columns:
    """Return head poses at the reference height, smoothed."""
    t_ns, valid = columns["t_host_ns"], columns["valid"].astype(bool)
    position = smooth(columns["position_m"].astype(np.float64), valid, t_ns)
    wanted_m = SEATED_EYE_M if MIN_EYE_M < median_m <= MAX_SEATED_EYE_M else STANDING_EYE_M
    position[:, 1] = at_height(position[:, 1], valid, median_m, wanted_m)
    turns = smooth_turns(columns["orientation_wxyz"].astype(np.float64), valid, t_ns)
    return _with(columns, position_m=position, orientation_wxyz=turns)


def blurred_body(columns: Columns, names: tuple[str, ...], median_m: float) -> Columns:
    """Return a body's segments (see `has_reference`) on the reference skeleton, smoothed.

    A segment is where the smoothed turns of those between the hips and it put it; it counts as
    tracked where all of them are.
    """
    skeleton = canonical_skeleton(STATURE_M)
    n, t_ns = len(columns["t_host_ns"]), columns["t_host_ns"]
    valid = columns["valid"].astype(bool)
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (n, len(skeleton.names), 1))
    is_tracked = np.zeros((n, len(skeleton.names)), bool)
    own = columns["orientation_wxyz"].astype(np.float64)
    for i, name in enumerate(names):
        j = skeleton.index(name)
        own_turns = smooth_turns(own[:, i], valid[:, i], t_ns)
        turns[:, j] = np.where(valid[:, i, None], own_turns, turns[:, j])
        is_tracked[:, j] = valid[:, i]
    for j, parent in enumerate(skeleton.parents):
        if parent >= 0:
            missing = skeleton.names[j] not in names
            is_tracked[:, j] = is_tracked[:, parent] & (is_tracked[:, j] | missing)
            if missing:
                turns[:, j] = turns[:, parent]
    hips = names.index("hips")
    root = smooth(columns["position_m"][:, hips].astype(np.float64), valid[:, hips], t_ns)
    standing_m = -float(skeleton.rest_m[:, 1].min())
    root[:, 1] = at_height(root[:, 1], valid[:, hips], median_m, standing_m)
    pose = forward(skeleton, np.nan_to_num(root), local_of_world(skeleton, turns))
    at = [skeleton.index(name) for name in names]
    is_valid = is_tracked[:, at]
    position = np.where(is_valid[..., None], pose.position_m[:, at], np.nan)
    orientation = np.where(is_valid[..., None], turns[:, at], np.nan)
    return _with(columns, position_m=position, orientation_wxyz=orientation, valid=is_valid)


def blurred_gaze(columns: Columns) -> Columns:
    """Return gaze without the distance of the eyes and without pupils: one direction for both."""
    new_columns: dict[str, npt.NDArray[Any]] = {}
    for name, values in columns.items():
        if name in ("left_direction_head", "right_direction_head"):
            new_columns[name] = columns["direction_head"]
        elif name.endswith("_mm") or (name.endswith("_m") and values.dtype.kind == "f"):
            new_columns[name] = np.full(values.shape, 0.0 if name.endswith("_m") else np.nan)
    return _with(columns, **new_columns)


def blurred_targets(columns: Columns, gaze: Columns | None, head: Columns | None) -> Columns:
    """Return where gaze fell, seen from the blurred head.

    How far outside a head it fell is rounded up to steps of `OUTSIDE_STEP_DEG` and missing beyond
    `MAX_OUTSIDE_DEG`, heads have their median size, and within a head the angle is half of it, so
    that areas of interest with a padding of whole steps are decided as before.
    """
    n = len(columns["t_host_ns"])
    direction, origin = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    if gaze is not None and head is not None and len(head["seq"]) and len(gaze["seq"]):
        has_gaze = np.isin(columns["gaze_seq"], gaze["seq"]) & columns["valid"].astype(bool)
        order = np.argsort(gaze["seq"], kind="stable")
        row = order[np.searchsorted(gaze["seq"], columns["gaze_seq"][has_gaze], sorter=order)]
        at = np.searchsorted(head["t_host_ns"], columns["t_sample_ns"][has_gaze])
        at = np.minimum(at, len(head["t_host_ns"]) - 1)
        turn = head["orientation_wxyz"][at].astype(np.float64)
        direction[has_gaze] = rotate(turn, gaze["direction_head"][row].astype(np.float64))
        origin[has_gaze] = head["position_m"][at]
    angle = columns["angle_deg"].astype(np.float64)
    radius = columns["radius_deg"].astype(np.float64)
    size = _median_size(radius)
    outside = np.ceil((angle - radius) / OUTSIDE_STEP_DEG - 1e-6) * OUTSIDE_STEP_DEG
    blurred_deg = np.where(angle < radius * _RIM, size / 2, size + np.maximum(outside, 0.0))
    blurred_deg = np.where(outside > MAX_OUTSIDE_DEG, FAR_DEG, blurred_deg)
    limit = np.floor(columns["pad_limit_deg"].astype(np.float64) / OUTSIDE_STEP_DEG)
    return _with(
        columns,
        direction_world=direction,
        origin_world_m=origin,
        angle_deg=np.where(np.isfinite(angle), blurred_deg, np.nan),
        radius_deg=np.where(np.isfinite(radius), size, np.nan),
        pad_limit_deg=limit * OUTSIDE_STEP_DEG,
    )


def _median_size(radius_deg: Vector) -> Vector:
    """Return each head's median size (1, m) in steps, at least one; NaN where it is not seen."""
    size = np.full((1, radius_deg.shape[1]), np.nan)
    for j in range(radius_deg.shape[1]):
        radii_deg = radius_deg[np.isfinite(radius_deg[:, j]), j]
        if len(radii_deg):
            steps = max(1.0, float(np.round(np.median(radii_deg) / OUTSIDE_STEP_DEG)))
            size[0, j] = steps * OUTSIDE_STEP_DEG
    return size


def _with(columns: Columns, **new_columns: npt.NDArray[Any]) -> Columns:
    """Replace columns, each kept in its own type."""
    return {
        name: new_columns[name].astype(values.dtype) if name in new_columns else values
        for name, values in columns.items()
    }

"""Walking measured from a track: speed without the stop, path, hesitations, clearance, shoulders.

Ground plane: (x, z) in metres. Lost samples are NaN and nothing is invented for them: they end a
stretch of walking and count in `lost_s`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.cells import CellPath, Triangulation, folded_angle_deg
from visavis.lab.compiled import compiled
from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector

STEP_LENGTH_M: Final = {"man": 0.74, "woman": 0.67}
"""One step (Cho et al. 2004), the radius of the stop left out round the point nearest the board."""
STEP_LENGTH_UNKNOWN_M: Final = 0.705
"""The mean of both, for people who are neither or did not say."""
MAX_GAP_NS: Final = 100_000_000
PATH_LOST_01: Final = 0.01
"""A way with more of its time lost has no length: it would be too short by an unknown amount."""
HESITATION_BELOW_M_S: Final = 0.10
HESITATION_AT_LEAST_S: Final = 0.5


@dataclass(frozen=True)
class WalkMeasures:
    """One walk. Speeds in m/s; NaN where nothing could be measured.

    `speed_m_s` is the mean over samples farther than one step from the place nearest the board
    (the published measure), `speed_whole_m_s` over all, `path_m` the length of the way over the
    ground (low-pass filtered below 1 Hz by averaging over a stride would be shorter; NaN where more
    than a hundredth of the time was lost, as nobody knows the way meanwhile), `time_s`
    from first to last sample, `stop_s` what was left out, `hesitations` stretches slower than
    0.1 m/s for at least 0.5 s outside the stop once walking has begun, `hesitation_s` their sum,
    `lost_s` untracked time.
    """

    speed_m_s: float
    speed_whole_m_s: float
    path_m: float
    time_s: float
    stop_s: float
    hesitations: int
    hesitation_s: float
    lost_s: float


def step_length_m(sex: str | None) -> float:
    """Return the step of a person as the study had it: 0.74 m men, 0.67 m women."""
    return STEP_LENGTH_M.get(sex or "", STEP_LENGTH_UNKNOWN_M)


@compiled
def interpolate_rows(
    t_ns: npt.NDArray[np.int64],
    position: Vector,
    orientation: Vector,
    grid_ns: npt.NDArray[np.int64],
    longest_gap_ns: int,
    out_position: Vector,
    out_orientation: Vector,
) -> None:
    """Interpolate segments (n, s, 3) and (n, s, 4) to other times; NaN across longer gaps.

    Positions linearly, orientations along the shorter chord, normalised. A segment that is NaN on
    either side of a time is NaN there; at the very time of a sample, that sample stands.
    """
    n, segments = position.shape[0], position.shape[1]
    j = 0
    for i in range(grid_ns.shape[0]):
        t = grid_ns[i]
        while j < n - 2 and t_ns[j + 1] <= t:
            j += 1
        # At the very time of a sample its neighbour must not turn it into NaN.
        at_sample = n > 0 and t == t_ns[j]
        k = j if at_sample else j + 1
        if not at_sample and (
            n < 2 or t < t_ns[0] or t > t_ns[n - 1] or t_ns[k] - t_ns[j] > longest_gap_ns
        ):
            out_position[i], out_orientation[i] = np.nan, np.nan
            continue
        share = 0.0 if at_sample else (t - t_ns[j]) / (t_ns[k] - t_ns[j])
        for s in range(segments):
            for c in range(3):
                a, b = position[j, s, c], position[k, s, c]
                out_position[i, s, c] = a + share * (b - a)
            dot = 0.0
            for c in range(4):
                dot += orientation[j, s, c] * orientation[k, s, c]
            # q and −q are one rotation; the nearer sign gives the shorter way.
            sign = -1.0 if dot < 0 else 1.0
            size = 0.0
            for c in range(4):
                a, b = orientation[j, s, c], sign * orientation[k, s, c]
                out_orientation[i, s, c] = a + share * (b - a)
                size += out_orientation[i, s, c] ** 2
            for c in range(4):
                out_orientation[i, s, c] /= np.sqrt(size)


def resample(
    t_ns: npt.NDArray[np.int64],
    position: Vector,
    orientation: Vector,
    grid_ns: npt.NDArray[np.int64],
    *,
    longest_gap_ns: int = MAX_GAP_NS,
) -> tuple[Vector, Vector]:
    """Return segments at the times of a grid; see `interpolate_rows`.

    Raises:
        DataError: times do not rise.
    """
    if (np.diff(t_ns) <= 0).any():
        row = int(np.argmax(np.diff(t_ns) <= 0)) + 1
        raise DataError(f"body sample {row}: time does not rise; sort the samples, drop repeats")
    shape = (len(grid_ns), *position.shape[1:2])
    at, turn = np.empty((*shape, 3)), np.empty((*shape, 4))
    interpolate_rows(t_ns, position, orientation, grid_ns, longest_gap_ns, at, turn)
    return at, turn


def walk_measures(
    t_ns: npt.NDArray[np.int64], place_m: Vector, board_m: npt.ArrayLike, step_m: float
) -> WalkMeasures:
    """Measure a walk: `place_m` (n, 2) at evenly spaced times (n,), NaN where lost."""
    if len(t_ns) < 3:
        nan = float("nan")
        return WalkMeasures(nan, nan, nan, nan, nan, 0, 0.0, nan)
    dt_s = np.diff(t_ns) / 1e9
    steps_m = np.linalg.norm(np.diff(place_m, axis=0), axis=1)
    is_known = np.isfinite(steps_m)
    speed = steps_m / dt_s
    to_board = np.linalg.norm(place_m - np.asarray(board_m, float), axis=1)
    walking = is_known.copy()
    if np.isfinite(to_board).any():
        nearest = place_m[int(np.nanargmin(to_board))]
        with np.errstate(invalid="ignore"):
            away = np.linalg.norm(place_m - nearest, axis=1) > step_m
        walking &= away[:-1] & away[1:]
    slow = _smooth(np.where(is_known, speed, np.nan), dt_s) < HESITATION_BELOW_M_S
    moving = np.flatnonzero(is_known & ~slow)
    first_moving = moving[0] if len(moving) else len(is_known)
    runs = [(a, b) for a, b in _runs(slow & walking) if a >= first_moving]
    long = [float(dt_s[a:b].sum()) for a, b in runs]
    long = [s for s in long if s >= HESITATION_AT_LEAST_S]
    is_whole = dt_s[~is_known].sum() <= PATH_LOST_01 * dt_s.sum()
    return WalkMeasures(
        speed_m_s=_ratio(steps_m[walking].sum(), dt_s[walking].sum()),
        speed_whole_m_s=_ratio(steps_m[is_known].sum(), dt_s[is_known].sum()),
        path_m=float(steps_m[is_known].sum()) if is_whole else float("nan"),
        time_s=float((t_ns[-1] - t_ns[0]) / 1e9),
        stop_s=float(dt_s[is_known & ~walking].sum()),
        hesitations=len(long),
        hesitation_s=float(sum(long)),
        lost_s=float(dt_s[~is_known].sum()),
    )


def clearance_m(place_m: Vector, people_m: Vector) -> Vector:
    """Return the distance (n,) from each place to the nearest person's centre; NaN where lost."""
    apart = np.linalg.norm(place_m[:, None] - people_m, axis=2)
    nearest: Vector = apart.min(axis=1)
    return nearest


def crossing_angles_deg(
    triangulation: Triangulation, path: CellPath, left_m: Vector, right_m: Vector
) -> tuple[Vector, Vector]:
    """Return (k,) per crossing: shoulders to the gap (published), shoulders to the way walked.

    `left_m`, `right_m` (n, 2) are the shoulders at the path's samples. The first is 0° with the
    shoulders along the gap and 90° turned through it; it mixes turning with passing obliquely. The
    second is 0° facing the way and 90° sidewards. NaN where a shoulder was lost.
    """
    if not path.crossings:
        return np.empty(0), np.empty(0)
    s = np.array([c.s for c in path.crossings])
    low = np.minimum(s.astype(int), len(left_m) - 1)
    high = np.minimum(low + 1, len(left_m) - 1)
    share = (s - low)[:, None]
    axis = left_m - right_m
    shoulders = axis[low] + share * (axis[high] - axis[low])
    points = triangulation.positions_m
    gaps = np.array([points[c.edge[1]] - points[c.edge[0]] for c in path.crossings])
    heading = np.array([c.heading for c in path.crossings])
    square = np.stack([-heading[:, 1], heading[:, 0]], axis=1)
    return folded_angle_deg(shoulders, gaps), folded_angle_deg(shoulders, square)


def _smooth(speed: Vector, dt_s: Vector) -> Vector:
    """Average speed over a quarter of a second, so that no single sample makes a stop."""
    width = max(round(0.25 / float(np.median(dt_s))), 1)
    kernel = np.ones(width) / width
    with_ends = np.concatenate(
        [np.full(width // 2, speed[0]), speed, np.full(width - 1 - width // 2, speed[-1])]
    )
    mean_speed: Vector = np.convolve(with_ends, kernel, mode="valid")
    return mean_speed


def _runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _ratio(a: float, b: float) -> float:
    return float(a / b) if b > 0 else float("nan")

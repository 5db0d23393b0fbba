"""Find tracked segments of a body that repeat their last pose while the others move on.

A tracker that dies may go on reporting its last pose. Its segment then stands in the room while the
body walks away. A segment counts as frozen when its position, or its orientation, has repeated bit
for bit for longer than a limit, until it changes again. It must have moved sample by sample before,
and in each repeated sample most other segments must have changed in the same respect. Orientations,
above all the trunk's, may rest in a calm body. So they must repeat for half a second, on no more
segments than a limb has. Feet and toes stand on the floor, and some trackers hold them there. They
count as frozen only when the hips have meanwhile moved farther than a leg reaches.
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Fault
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Flags = npt.NDArray[np.bool_]
MovedChannels = frozenset[tuple[str, int]]
"""Segments that moved, each with 0 (its position) or 1 (its orientation)."""

MAX_REPEAT_NS: Final = 150 * NS_PER_MS
HELD_BY_FLOOR: Final = ("left_foot", "left_toes", "right_foot", "right_toes")
_STRIDE_M: Final = 1.0
_LIMB: Final = 4
_CALM_NS: Final = 500 * NS_PER_MS
_UNKNOWN, _SAME, _CHANGED = 0, 1, 2


class _State(NamedTuple):
    """What a watch knows of s segments; the last dimension of two is position, orientation."""

    limit_ns: int
    hips: int
    """The place of the hips among the segments; -1 without hips."""
    is_held_by_floor: Flags
    """(s,) feet and toes."""
    last: Vector
    """(s, 7) position and orientation in the last sample."""
    changed_ns: npt.NDArray[np.int64]
    """(s, 2) for how long each has changed from sample to sample."""
    still_ns: npt.NDArray[np.int64]
    """(s, 2) for how long each has repeated itself while others moved."""
    has_moved: Flags
    """(s, 2) which have moved on their own before."""
    hips_m: Vector
    """(s, 2, 2) where the hips were over the floor when the repeating began."""
    change: npt.NDArray[np.int8]
    """(s, 2) unknown, the same or changed in the last sample."""
    is_frozen: Flags
    """(s, 2) which are frozen now."""


class SegmentWatch:
    """Look at a body sample by sample.

    `frozen` (s,) tells which segments are frozen in the last sample, `frozen_ns` (s,) for how long
    each was frozen so far, without the detection time, and `still_ns` (s,) for how long each
    repeats its pose now. `moved_channels` are those known to have moved before.
    """

    def __init__(
        self,
        segments: Sequence[str],
        *,
        limit_ns: int = MAX_REPEAT_NS,
        moved_channels: Iterable[tuple[str, int]] = (),
    ) -> None:
        n = len(segments)
        self.segments = tuple(segments)
        self.frozen_ns = np.zeros(n, np.int64)
        self._state = _State(
            limit_ns=limit_ns,
            hips=self.segments.index("hips") if "hips" in segments else -1,
            is_held_by_floor=np.array([name in HELD_BY_FLOOR for name in segments], bool),
            last=np.full((n, 7), np.nan),
            changed_ns=np.zeros((n, 2), np.int64),
            still_ns=np.zeros((n, 2), np.int64),
            has_moved=np.zeros((n, 2), bool),
            hips_m=np.full((n, 2, 2), np.nan),
            change=np.zeros((n, 2), np.int8),
            is_frozen=np.zeros((n, 2), bool),
        )
        for name, channel in moved_channels:
            if name in self.segments:
                self._state.has_moved[self.segments.index(name), channel] = True
        # loads the compiled code: the first sample of a session must not wait for it
        self.look(np.full((n, 3), np.nan), np.full((n, 4), np.nan), 0)

    @property
    def frozen(self) -> Flags:
        """Which segments are frozen now."""
        return np.logical_or(self._state.is_frozen[:, 0], self._state.is_frozen[:, 1])

    @property
    def frozen_for_ns(self) -> dict[str, int]:
        """For how long each segment was frozen, those that ever were."""
        return {
            name: ns for name, ns in zip(self.segments, self.frozen_ns.tolist(), strict=True) if ns
        }

    @property
    def still_ns(self) -> npt.NDArray[np.int64]:
        """How long each segment has repeated its pose while others moved."""
        longest: npt.NDArray[np.int64] = self._state.still_ns.max(axis=1)
        return longest

    @property
    def moved_channels(self) -> MovedChannels:
        """Which segments and channels have moved on their own so far."""
        return frozenset(
            (self.segments[s], int(c)) for s, c in np.argwhere(self._state.has_moved).tolist()
        )

    def look(self, position_m: Vector, orientation_wxyz: Vector, gap_ns: int) -> bool:
        """Take in the next sample, (s, 3) and (s, 4), NaN where lost; tell whether any is frozen.

        `gap_ns` is the time since the sample before.
        """
        at = np.ascontiguousarray(position_m, np.float64)
        turn = np.ascontiguousarray(orientation_wxyz, np.float64)
        if not _look(at, turn, gap_ns, self._state):
            return False
        self.frozen_ns[self.frozen] += gap_ns
        return True

    def fault(self, role: str) -> Fault | None:
        """Tell the operator which segments are frozen now, and for how long; None when none is."""
        names = [self.segments[s] for s in np.flatnonzero(self.frozen).tolist()]
        if not names:
            return None
        longest_s = int(self.still_ns[self.frozen].max()) / NS_PER_S
        verb = "repeats its" if len(names) == 1 else "repeat their"
        return Fault(
            role,
            "warning",
            f"{', '.join(names)} {verb} last pose while the body moves, for {longest_s:.1f} s now",
            "look at the sensor or marker there; restart it or the tracker's stream",
        )

    def repeats(
        self, t_ns: npt.NDArray[np.int64], position_m: Vector, orientation_wxyz: Vector
    ) -> Flags:
        """Tell (n, s) which of all samples, (n, s, 3) and (n, s, 4), repeat a frozen pose.

        These include the repeats before the detection, but not the first, true sample.
        """
        is_repeat = np.zeros(position_m.shape[:2], bool)
        _look_at_all(t_ns, position_m, orientation_wxyz, is_repeat, self._state)
        return is_repeat


@compiled
def _look(
    position: Vector,
    turn: Vector,
    gap_ns: int,
    state: _State,
) -> bool:
    """Renew the state of a watch by the next sample; return whether any segment is frozen."""
    # Names of their own: the loops below read the arrays often.
    changed_ns, still_ns = state.changed_ns, state.still_ns
    has_moved, frozen, how, last = state.has_moved, state.is_frozen, state.change, state.last
    hips, hips_m, limit_ns = state.hips, state.hips_m, state.limit_ns
    n = position.shape[0]
    is_any = False
    hips_x = hips_z = np.nan
    if hips >= 0:
        hips_x, hips_z = position[hips, 0], position[hips, 2]
    for c in range(2):
        first, width = 3 * c, 3 + c
        pose = position if c == 0 else turn
        # Compare every segment with its last pose, and count how many moved: only a repeat beside
        # moving segments is suspicious, since a calm body repeats as a whole.
        tracked_count = changed_count = 0
        for s in range(n):
            how[s, c] = _SAME
            for k in range(width):
                new, old = pose[s, k], last[s, first + k]
                if not (np.isfinite(new) and np.isfinite(old)):
                    how[s, c] = _UNKNOWN
                elif new != old and how[s, c] == _SAME:
                    how[s, c] = _CHANGED
                last[s, first + k] = new
            tracked_count += how[s, c] != _UNKNOWN
            changed_count += how[s, c] == _CHANGED
        # A change ends the freeze. A repeat adds time, while most other segments move.
        for s in range(n):
            if how[s, c] != _SAME:
                still_ns[s, c] = 0
                frozen[s, c] = False
                hips_m[s, c, 0], hips_m[s, c, 1] = hips_x, hips_z
                changed_ns[s, c] = changed_ns[s, c] + gap_ns if how[s, c] == _CHANGED else 0
                if changed_ns[s, c] > limit_ns:
                    has_moved[s, c] = True
                continue
            if changed_count > 0:
                changed_ns[s, c] = 0
                most_rest = tracked_count if c == 0 else _LIMB
                if (
                    2 * changed_count > tracked_count - 1
                    and tracked_count - changed_count <= most_rest
                ):
                    still_ns[s, c] += gap_ns
                elif not frozen[s, c]:
                    still_ns[s, c] = 0
                    hips_m[s, c, 0], hips_m[s, c, 1] = hips_x, hips_z
            # Feet may rest on the floor until the hips are farther away than a leg reaches.
            longest_ns = limit_ns if c == 0 else max(limit_ns, _CALM_NS)
            if has_moved[s, c] and still_ns[s, c] > longest_ns and not frozen[s, c]:
                away = np.hypot(hips_x - hips_m[s, c, 0], hips_z - hips_m[s, c, 1])
                frozen[s, c] = not state.is_held_by_floor[s] or away > _STRIDE_M
            is_any = is_any or frozen[s, c]
    return is_any


@compiled
def _look_at_all(
    t_ns: npt.NDArray[np.int64],
    position: Vector,
    turn: Vector,
    repeats: Flags,
    state: _State,
) -> None:
    """Mark the samples (n, s) of all samples that repeat a frozen pose."""
    how, frozen, still_ns = state.change, state.is_frozen, state.still_ns
    n_segments = position.shape[1]
    # The sample in which each segment last showed where it truly was: a freeze is known only when
    # it has lasted, and then marks all samples after that one.
    true_one = np.zeros((n_segments, 2), np.int64)
    for i in range(position.shape[0]):
        gap_ns = t_ns[i] - t_ns[i - 1] if i else 0
        _look(position[i], turn[i], gap_ns, state)
        for s in range(n_segments):
            for c in range(2):
                if how[s, c] != _SAME:
                    true_one[s, c] = i
                elif frozen[s, c]:
                    for k in range(true_one[s, c] + 1, i + 1):
                        repeats[k, s] = True
                    true_one[s, c] = i
                elif still_ns[s, c] == 0 and _changed_in(how, c):
                    true_one[s, c] = i


@compiled
def _changed_in(how: npt.NDArray[np.int8], channel: int) -> bool:
    """Tell whether anything changed in a channel."""
    for s in range(how.shape[0]):
        if how[s, channel] == _CHANGED:
            return True
    return False

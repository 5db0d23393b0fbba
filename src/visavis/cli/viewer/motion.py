"""Motion as few key poses: what lies between them is found again within a stated error."""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector

Ints = npt.NDArray[np.int64]


@compiled
def _equal(one: Vector, other: Vector) -> bool:
    for c in range(len(one)):
        if one[c] != other[c]:
            return False
    return True


@compiled
def _find_keys(values: Vector, off_by: float, longest: int, turns: bool) -> npt.NDArray[np.bool_]:
    """Tell which samples (n,) of one track (n, k) are keys: straight lines between keys stay within
    `off_by` of every sample.
    """
    n, k = values.shape
    is_key = np.zeros(n, np.bool_)
    is_key[0] = is_key[n - 1] = True
    first = 0
    while first < n - 1:
        last = first + 1
        is_still = _equal(values[last], values[first])
        while last + 1 < n and last + 1 - first <= longest:
            fits = True
            is_still = is_still and _equal(values[last + 1], values[first])
            # Of samples that are all the same the first one tells of every one.
            for i in range(first + 1, first + 2 if is_still else last + 1):
                share = (i - first) / (last + 1 - first)
                length = 0.0
                for c in range(k):
                    there = values[first, c] + share * (values[last + 1, c] - values[first, c])
                    length += there * there
                scale = 1.0 / np.sqrt(length) if turns and length > 0.0 else 1.0
                error = 0.0
                for c in range(k):
                    there = values[first, c] + share * (values[last + 1, c] - values[first, c])
                    error = max(error, abs(scale * there - values[i, c]))
                if not error <= off_by:
                    fits = False
                    break
            if not fits:
                break
            last += 1
        is_key[last] = True
        first = last
    return is_key


@compiled
def _find_all_keys(
    tracks: Vector, off_by: float, longest: int, turns: bool
) -> npt.NDArray[np.bool_]:
    is_key = np.zeros(tracks.shape[:2], np.bool_)
    for t in range(tracks.shape[0]):
        is_key[t] = _find_keys(tracks[t], off_by, longest, turns)
    return is_key


def key_samples(
    tracks: Vector, off_by: float, *, turns: bool, longest: int = 60
) -> tuple[Ints, Ints]:
    """Return how many keys each of the tracks (t, n, k) has (t,), and which samples they are, one
    track after the other. Tracks of quaternions (`turns`) are normalised between keys.
    """
    is_key = _find_all_keys(np.ascontiguousarray(tracks, np.float64), off_by, longest, turns)
    return is_key.sum(axis=1), np.nonzero(is_key)[1]

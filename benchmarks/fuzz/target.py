"""One reader, what it is given, and what it may say."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from scipy.stats import binom

from benchmarks.fuzz.damage import damaged


def anything(result: object) -> bool:
    """Take whatever a reader returns: its format has nothing that damage could contradict."""
    return True


@dataclass(frozen=True)
class Target:
    """A reader of bytes: `samples` are whole inputs, `refusals` the errors it may answer with.

    `is_sound` tells of a result whether the reader may return it, however damaged the input was.
    Of the inputs that every target gets, one that does far more than read gets `share_01`.
    """

    name: str
    samples: tuple[bytes, ...]
    read: Callable[[bytes], object]
    refusals: tuple[type[Exception], ...] = ()
    is_sound: Callable[[object], bool] = anything
    change: Callable[[bytes, bytes, Iterator[int]], bytes] = damaged
    """What makes an input of a sample, another sample and drawn numbers."""
    share_01: float = 1.0
    checksum_bits: int = 0
    """Width of the checksum that alone tells a damaged input from a whole one; 0 without one."""


CHANCE_01 = 0.001
"""How often a sound reader may pass what its checksum should let through by chance."""


def may_pass(checksum_bits: int, damaged_frames: int) -> int:
    """Return how many damaged frames a checksum may let through: of n bits, one frame in 2ⁿ.

    More pass with a probability of `CHANCE_01` at most (binomial); without a checksum none may.
    """
    if not checksum_bits:
        return 0
    return int(binom.isf(CHANCE_01, damaged_frames, 0.5**checksum_bits))

"""One reader, what it is given, and what it may say."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

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

"""One reader, what it is given, and what it may say."""

from collections.abc import Callable
from dataclasses import dataclass


def anything(result: object) -> bool:
    """Take whatever a reader returns: its format has nothing that damage could contradict."""
    return True


@dataclass(frozen=True)
class Target:
    """A reader of bytes: `samples` are whole inputs, `refusals` the errors it may answer with.

    `is_sound` tells of a result whether the reader may return it, however damaged the input was.
    """

    name: str
    samples: tuple[bytes, ...]
    read: Callable[[bytes], object]
    refusals: tuple[type[Exception], ...] = ()
    is_sound: Callable[[object], bool] = anything

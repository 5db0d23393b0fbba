"""The trials that sessions elsewhere have finished, counted by what their recorders wrote."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

TRIAL: Final = b'"kind":"trial"'
"""Where a journal's line is that of a finished trial."""
LOOK_AGAIN_S: Final = 1.0


class TrialCounter:
    """Count finished trials in the journals of sessions; what was counted is not read again."""

    def __init__(self, sessions: Sequence[Path]) -> None:
        self._sessions = tuple(sessions)
        self._read: dict[Path, tuple[int, int]] = {}

    def count(self) -> int:
        """Return how many there are now; journals that nobody can read count as before."""
        for session in self._sessions:
            for journal in session.glob("part-*/events.jsonl"):
                at, trials = self._read.get(journal, (0, 0))
                try:
                    with journal.open("rb") as file:
                        file.seek(at)
                        lines = file.read()
                except OSError:
                    continue
                whole = lines.rfind(b"\n") + 1  # the last line may still be written
                self._read[journal] = at + whole, trials + lines.count(TRIAL, 0, whole)
        return sum(trials for _, trials in self._read.values())


@contextmanager
def repeating(act: Callable[[], None], every_s: float = LOOK_AGAIN_S) -> Iterator[None]:
    """Call something in the background until the block ends, and once when it has ended well."""
    ends = threading.Event()

    def go_on() -> None:
        while not ends.wait(every_s):
            act()

    thread = threading.Thread(target=go_on, name="progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()
    act()

"""Signals that ask a program to end: of the keyboard, the system, and a closed terminal."""

import signal
from typing import Final

ENDING_SIGNALS: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Signals of Ctrl-C, the system, and a closed terminal (Windows: SIGBREAK)."""


def let_signals_interrupt() -> None:
    """Let every ending signal interrupt, as Ctrl-C does, so that all is closed properly."""

    def end(*_: object) -> None:
        raise KeyboardInterrupt

    for name in ENDING_SIGNALS:
        if hasattr(signal, name) and name != "SIGINT":
            signal.signal(getattr(signal, name), end)

"""Read single keys from the terminal without blocking, on POSIX and Windows."""

import importlib
import os
import select
import sys
from typing import Any


class KeyReader:
    """Put the terminal in single-key mode while open; a no-op when stdin is no terminal."""

    def __init__(self) -> None:
        self._saved: list[Any] | None = None
        self._active = sys.stdin.isatty()

    def __enter__(self) -> "KeyReader":
        if self._active and os.name == "posix":
            termios, tty = importlib.import_module("termios"), importlib.import_module("tty")
            self._saved = termios.tcgetattr(sys.stdin)
            tty.setcbreak(sys.stdin)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._saved is not None:
            termios = importlib.import_module("termios")
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, self._saved)
            self._saved = None

    def keys(self) -> str:
        """Return the keys pressed since the last call; arrow and function keys are left out."""
        if not self._active:
            return ""
        if os.name == "nt":
            return self._windows_keys()
        if not select.select([sys.stdin], [], [], 0)[0]:
            return ""
        text = os.read(sys.stdin.fileno(), 1024).decode(errors="ignore")
        return "" if len(text) > 1 and text.startswith("\x1b[") else text

    @staticmethod
    def _windows_keys() -> str:
        msvcrt = importlib.import_module("msvcrt")
        keys = ""
        while msvcrt.kbhit():
            key = msvcrt.getwch()
            if key in ("\x00", "\xe0"):
                msvcrt.getwch()
            else:
                keys += key
        return keys

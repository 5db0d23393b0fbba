"""The command hears signals wherever it is, and says what it did about them."""

import ctypes
import signal
import sys
import threading
from types import SimpleNamespace

import pytest

from cli.main import interrupting_again


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send SIGTERM to itself")
def test_signal_dropped_by_a_library_that_calls_back_comes_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dropped: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", interrupting_again(dropped.append))
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
    former = signal.signal(signal.SIGTERM, _interrupt)
    try:
        callback()
        with pytest.raises(KeyboardInterrupt):
            threading.Event().wait(10.0)  # it would go on as if nothing had been asked
    finally:
        signal.signal(signal.SIGTERM, former)
    assert [] == dropped


def test_other_exceptions_nobody_can_catch_go_to_the_hook_of_before() -> None:
    seen: list[object] = []
    unraisable = SimpleNamespace(exc_type=ValueError)
    interrupting_again(seen.append)(unraisable)
    assert [unraisable] == seen

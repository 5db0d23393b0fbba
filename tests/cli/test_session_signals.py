"""Whatever asks a session to end is heard at the next frame; asked again, it ends at once."""

import os
import signal
from types import SimpleNamespace
from typing import Any

import pytest

from visavis.cli.commands.session import _let_signals_end


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot send these to its own process")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_asks_for_the_end_and_a_second_one_ends_at_once(number: signal.Signals) -> None:
    former = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    screen: Any = SimpleNamespace(abort_requested=False, is_suspended=False)
    try:
        _let_signals_end(screen)
        signal.raise_signal(number)
        assert screen.abort_requested
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(number)
    finally:
        for each, handler in former.items():
            signal.signal(each, handler)

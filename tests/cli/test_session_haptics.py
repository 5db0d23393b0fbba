"""However a session ends, its armbands are silent: at its end, by error, signal or standstill."""

import os
import signal
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import visavis.running.sessions.perform
from tests.devices.band_makers import simulated_armband
from tests.faults.sessions import lab, request
from visavis.devices.drivers.armband.driver import ArmbandDriver
from visavis.devices.sim.armband.simulator import ArmbandSimulator
from visavis.lab.clock import Clock, SimClock, SystemClock
from visavis.lab.errors import SessionAborted
from visavis.protocol.session.operator import Command, UnattendedOperator

ROLE = "armband_left_forearm"
ON = (1.0, 1.0, 1.0, 1.0)
LONG_MS = 10_000


class WornBand:
    """A simulated band in the session's rig; tells when it was silenced."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.peer: ArmbandSimulator | None = None
        self.driver: ArmbandDriver = simulated_armband(ROLE, clock, wrap=self._keep)
        self.silenced = threading.Event()
        own = self.driver.silence

        def silence() -> int:
            self.silenced.set()
            return own()

        self.driver.silence = silence  # type: ignore[method-assign]  # a spy

    def _keep(self, link: Any) -> Any:
        self.peer = link._peer
        return link

    @property
    def is_off(self) -> bool:
        assert self.peer is not None
        self.peer.advance(self.clock.now_ns() + 50_000_000)
        return not any(self.peer.firmware.duties)

    def vibrate(self) -> None:
        self.driver.set_amplitudes(ON, LONG_MS)
        self.silenced.clear()


class ActingOperator(UnattendedOperator):
    """Act once, some frames after the band began to vibrate."""

    def __init__(self, band: WornBand, act: Any, after_frames: int = 8) -> None:
        super().__init__()
        self._band, self._act, self._frames_left = band, act, after_frames
        self.was_on = False

    def poll(self) -> tuple[Command, ...]:
        self._frames_left -= 1
        if self._frames_left == 4:
            self._band.vibrate()
        if self._frames_left == 0:
            self.was_on = not self._band.is_off
            self._act()
        return tuple(super().poll())


@pytest.fixture
def perform(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    def performed(clock: Clock, act: Any) -> tuple[WornBand, ActingOperator, Any]:
        band = WornBand(clock)
        build = visavis.running.sessions.perform.build_rig

        def with_band(*args: Any) -> Any:
            rig = build(*args)
            return replace(rig, others={**rig.others, ROLE: band.driver})

        monkeypatch.setattr(visavis.running.sessions.perform, "build_rig", with_band)
        operator = ActingOperator(band, act(band))
        wanted = replace(request(lab(tmp_path), operator), clock=clock)
        return band, operator, lambda: visavis.running.sessions.perform.perform_new(wanted)

    return performed


def test_session_that_ends_normally_leaves_the_band_silent(perform: Any) -> None:
    band, operator, run = perform(SimClock(), lambda band: lambda: None)
    run()
    assert operator.was_on
    assert band.silenced.is_set()
    assert band.is_off


def test_defect_in_the_session_leaves_the_band_silent(perform: Any) -> None:
    def fail() -> None:
        raise ZeroDivisionError

    band, operator, run = perform(SimClock(), lambda band: fail)
    with pytest.raises(ZeroDivisionError):
        run()
    assert operator.was_on
    assert band.silenced.is_set()
    assert band.is_off


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot send SIGTERM to its own process")
def test_signal_silences_before_the_session_hears_of_it(perform: Any) -> None:
    order: list[str] = []

    def interrupt(*_: object) -> None:
        order.append("handler, silent" if bands[0].silenced.is_set() else "handler, vibrating")
        raise KeyboardInterrupt

    former = signal.signal(signal.SIGTERM, interrupt)
    bands: list[WornBand] = []
    try:
        band, _, run = perform(
            SystemClock(), lambda band: lambda: os.kill(os.getpid(), signal.SIGTERM)
        )
        bands.append(band)
        with pytest.raises(SessionAborted):
            run()
        assert signal.getsignal(signal.SIGTERM) is interrupt
    finally:
        signal.signal(signal.SIGTERM, former)
    assert ["handler, silent"] == order
    assert band.is_off


def test_hung_frame_loop_is_silenced_while_it_hangs(perform: Any) -> None:
    heard: list[bool] = []

    def hang_and_end(band: WornBand) -> Any:
        def act() -> None:
            heard.append(band.silenced.wait(10.0))
            raise KeyboardInterrupt

        return act

    band, _, run = perform(SystemClock(), hang_and_end)
    with pytest.raises(SessionAborted):
        run()
    assert [True] == heard
    assert band.is_off

"""The voice key: its driver on PortAudio, and a simulated microphone."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from visavis.devices.contracts import Device
from visavis.devices.drivers.voice.driver import VoiceKey
from visavis.devices.drivers.voice.spec import VOICE_KEY, VoiceKeyOptions
from visavis.devices.sim.microphone import SimulatedMicrophone
from visavis.devices.sync.audio import sound_library
from visavis.devices.wiring import Site, Wiring

Load = Callable[[], Any]
"""Returns sounddevice, or a stand-in."""


@dataclass(frozen=True)
class SimulatedLibrary:
    """Load a simulated microphone instead of sounddevice."""

    site: Site[VoiceKeyOptions]

    def __call__(self) -> SimulatedMicrophone:
        """Return the library of a simulated microphone."""
        site, options = self.site, self.site.options
        return SimulatedMicrophone(
            site.clock,
            site.watched,
            faults=site.faults,
            latency_ms=options.latency_ms,
            drift_ppm=options.drift_ppm,
            seed=site.own_seed,
        )


def _make(site: Site[VoiceKeyOptions], load: Load) -> Device:
    return VoiceKey(
        site.role,
        load,
        site.clock,
        spec=site.spec,
        options=site.options,
        is_simulated=isinstance(load, SimulatedLibrary),
    )


def _real(site: Site[VoiceKeyOptions]) -> Load:
    return sound_library


WIRINGS = (
    Wiring[VoiceKeyOptions, Load](VOICE_KEY, make=_make, real=_real, simulated=SimulatedLibrary),
)

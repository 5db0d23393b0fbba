"""The sound card: its driver on PortAudio, and a simulated card."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from visavis.devices.contracts import Device, HearingBody
from visavis.devices.drivers.sound.driver import SoundCard
from visavis.devices.drivers.sound.spec import SOUND_CARD, SoundCardOptions
from visavis.devices.sim.sound_card import SimulatedPortAudio
from visavis.devices.sync.audio import sound_library
from visavis.devices.wiring import Site, Wiring

Load = Callable[[], Any]
"""Returns sounddevice, or a stand-in."""


@dataclass(frozen=True)
class SimulatedCard:
    """Load a simulated card instead of sounddevice."""

    site: Site[SoundCardOptions]

    def __call__(self) -> SimulatedPortAudio:
        """Return the library of a simulated card."""
        options = self.site.options
        return SimulatedPortAudio(
            self.site.clock,
            faults=self.site.faults,
            latency_ms=options.latency_ms,
            drift_ppm=options.drift_ppm,
            body=self.site.body if isinstance(self.site.body, HearingBody) else None,
        )


def _make(site: Site[SoundCardOptions], load: Load) -> Device:
    return SoundCard(
        site.role,
        load,
        site.clock,
        spec=site.spec,
        device=site.options.device,
        volume_01=site.options.volume_01,
        is_simulated=isinstance(load, SimulatedCard),
    )


def _real(site: Site[SoundCardOptions]) -> Load:
    return sound_library


WIRINGS = (
    Wiring[SoundCardOptions, Load](SOUND_CARD, make=_make, real=_real, simulated=SimulatedCard),
)

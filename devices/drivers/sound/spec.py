"""The sound card: options, library, simulator."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import Field

from visavis.devices.libraries import SOUNDDEVICE
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import AnySpec, DriverSpec, Site, imported

if TYPE_CHECKING:
    from collections.abc import Callable

    from visavis.devices.contracts import Device


class SoundCardOptions(SimulatedOptions):
    """Options of `sound_card`: which output, by its name or a part of it, and how loud at most.

    `latency_ms` and `drift_ppm` are of the simulated card: from a block's being asked for to its
    coming out, and how fast its crystal runs.
    """

    device: str = ""
    volume_01: float = Field(default=1.0, ge=0, le=1)
    latency_ms: float = Field(default=20.0, ge=1, le=500)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


def _make(site: Site[SoundCardOptions], load: "Callable[[], Any] | SimulatedCard") -> "Device":
    make = imported("visavis.devices.drivers.sound.driver:SoundCard")
    device: Device = make(
        site.role,
        load,
        site.clock,
        spec=site.spec,
        device=site.options.device,
        volume_01=site.options.volume_01,
        is_simulated=isinstance(load, SimulatedCard),
    )
    return device


def _real(site: Site[SoundCardOptions]) -> "Callable[[], Any]":
    return lambda: imported("visavis.devices.sync.audio:sound_library")()


@dataclass(frozen=True)
class SimulatedCard:
    """Stands where sounddevice would be loaded."""

    site: Site[SoundCardOptions]

    def __call__(self) -> Any:
        """Return the library of a card that plays to nobody."""
        options = self.site.options
        return imported("visavis.devices.sim.sound_card:SimulatedPortAudio")(
            self.site.clock,
            faults=self.site.faults,
            latency_ms=options.latency_ms,
            drift_ppm=options.drift_ppm,
        )


SOUND_CARD: AnySpec = DriverSpec(
    name="sound_card",
    kind="sound output",
    options=SoundCardOptions,
    make=_make,
    real=_real,
    simulated=SimulatedCard,
    carries="nothing",
    vendor="PortAudio",
    model="sound card",
    wire="the system's sound output",
    remedy="plug it in, and name it as device; `python -m sounddevice` lists what there is",
    library=SOUNDDEVICE,
    stands_for="any sound output of the computer, a headset's among them",
    checked="sounddevice on PortAudio over ALSA's null output; stamps on a stand-in; head model by "
    "its formulas",
    unproven="a card: whether its stamps are right (measure with `visavis sync-test --speaker`)",
)
SPECS = (SOUND_CARD,)

"""The sound card: its options and its description."""

from pydantic import Field

from visavis.devices.libraries import SOUNDDEVICE
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import AnySpec, Claims, DriverSpec, Product, Wire


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


SOUND_CARD: AnySpec = DriverSpec(
    name="sound_card",
    kind="sound output",
    options=SoundCardOptions,
    product=Product(vendor="PortAudio", model="sound card"),
    wire=Wire(medium="the system's sound output", carries="nothing", library=SOUNDDEVICE),
    remedy="plug it in, and name it as device; `python -m sounddevice` lists what there is",
    claims=Claims(
        stands_for="any sound output of the computer, a headset's among them",
        checked=(
            "sounddevice on PortAudio over ALSA's null output; stamps on a stand-in; head model by "
            "its formulas"
        ),
        unproven=(
            "a card: whether its stamps are right (measure with `visavis sync-test --speaker`)"
        ),
    ),
)
SPECS = (SOUND_CARD,)

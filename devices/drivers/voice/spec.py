"""The voice key: its options and its description."""

from dataclasses import replace
from typing import ClassVar

from pydantic import Field

from visavis.devices.drivers.buttons.spec import KEYS, ButtonNames
from visavis.devices.libraries import SOUNDDEVICE
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import AnySpec, Claims, DriverSpec, Product, Wire

VOICE = "voice"
"""The one control: pressed while somebody speaks."""


class VoiceKeyOptions(SimulatedOptions):
    """Options of `voice_key`: which microphone, by its name or a part of it, and what is a voice.

    A sound counts that is `threshold_db` louder than the room for `least_ms`; it has ended after
    `release_ms` of quiet. `latency_ms` and `drift_ppm` are of the simulated microphone: from a
    block's last sample to its arrival, and how fast the card's crystal runs.
    """

    controls: ClassVar[tuple[str, ...]] = (VOICE,)

    device: str = ""
    threshold_db: float = Field(default=15.0, ge=6, le=60)
    least_ms: float = Field(default=20.0, ge=5, le=500)
    release_ms: float = Field(default=300.0, ge=50, le=5000)
    latency_ms: float = Field(default=20.0, ge=1, le=500)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


VOICE_KEY: AnySpec = DriverSpec(
    name="voice_key",
    kind="responses",
    options=VoiceKeyOptions,
    product=Product(
        vendor="PortAudio", model="microphone", capabilities=frozenset({"voice", "own_time"})
    ),
    wire=Wire(medium="the system's sound input", carries="nothing", library=SOUNDDEVICE),
    remedy=(
        "plug the microphone in, allow programs to use it, and name it as device; "
        "`python -m sounddevice` lists what there is"
    ),
    claims=Claims(
        stands_for="any microphone of the computer, as a voice key",
        checked="planted onsets on a stand-in; sounddevice on PortAudio over PulseAudio",
        unproven=(
            "a microphone: its delay and whether the card's stamps are right; people's voices; "
            "whether the system finds it again once unplugged"
        ),
    ),
)


class VoiceAndKeyboardOptions(VoiceKeyOptions):
    """Options of `voice_and_keyboard`: those of `voice_key`, and what studies call keys."""

    controls: ClassVar = ()
    buttons: ClassVar = (*KEYS, VOICE)

    keys: ButtonNames = Field(default_factory=lambda: {"space": "trigger", "enter": "select"})


VOICE_AND_KEYBOARD: AnySpec = replace(
    VOICE_KEY,
    name="voice_and_keyboard",
    options=VoiceAndKeyboardOptions,
    product=Product(
        vendor="PortAudio",
        model="microphone and keyboard",
        capabilities=frozenset({"voice", "keys"}),
    ),
    wire=Wire(
        medium="the system's sound input and the window's events",
        carries="nothing",
        library=SOUNDDEVICE,
        hears_window=True,
    ),
    claims=Claims(
        stands_for="a microphone and the keyboard of this computer, as one response device",
        checked="as voice_key and keyboard; their order on a stand-in",
        unproven="as voice_key and keyboard",
    ),
)
SPECS = (VOICE_KEY, VOICE_AND_KEYBOARD)

"""Streams of Lab Streaming Layer: options and descriptions."""

from dataclasses import replace
from typing import Any

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm, ScreenOptions
from visavis.devices.libraries import LSL
from visavis.devices.options import StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

LISTENS = ("UDP 16571-16604", "TCP 16572-16604")
GAZE_REMEDY = (
    "start the program that sends the gaze stream, on this network and in the same LSL session, "
    "and check the firewall"
)


class LslGazeOptions(ScreenOptions):
    """Options of `lsl_gaze` and `tobii_lsl`; empty names match the only one of the type."""

    of_wire = frozenset({"stream_name", "stream_type", "source_id", "session_id"})

    stream_name: str = ""
    stream_type: str = "Gaze"
    source_id: str = ""
    session_id: str = ""
    exchange_interval_s: float = Field(default=5.0, gt=0, le=600)
    eye_distance_mm: EyeDistanceMm = 64.0


class LslBodyOptions(StreamOptions):
    """Options of `lsl_body`: which stream, and the stream's object -> segment."""

    of_wire = frozenset({"name", "source_id"})

    name: str = ""
    source_id: str = ""
    objects: dict[str, str] = Field(default_factory=dict)
    rate_hz: float = Field(default=60.0, ge=1, le=2000)

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and the objects that move."""
        return {**super().for_simulator(), "bodies": self.objects}


class LslStreamOptions(StreamOptions):
    """Options of `lsl_stream`; empty names match the only stream of the type.

    `channels`, `unit` and `rate_hz` count on a simulated wire only: a real stream says its own.
    """

    of_wire = frozenset(
        {"stream_name", "stream_type", "source_id", "session_id", "channels", "unit", "rate_hz"}
    )

    stream_name: str = ""
    stream_type: str = "EEG"
    source_id: str = ""
    session_id: str = ""
    channels: list[str] = Field(default_factory=lambda: ["Fz", "Cz", "Pz"], min_length=1)
    unit: str = "microvolts"
    rate_hz: float = Field(default=250.0, ge=1, le=50_000)
    exchange_interval_s: float = Field(default=5.0, gt=0, le=600)

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and the channels."""
        own = {"channels": self.channels, "unit": self.unit, "stream_type": self.stream_type}
        return {**super().for_simulator(), **own}


LSL_GAZE = DriverSpec(
    name="lsl_gaze",
    kind="eye tracker",
    options=LslGazeOptions,
    product=Product(
        vendor="LSL", model="LSL gaze stream", capabilities=frozenset({"gaze", "pupil"})
    ),
    wire=Wire(medium="LSL", library=LSL, listens=LISTENS),
    remedy=GAZE_REMEDY,
    claims=Claims(
        stands_for="any LSL gaze stream; TittaLSL",
        checked="genuine liblsl; TittaLSL's labels by our reading of its source",
        unproven="other senders' meta-data; a Tobii Pro",
    ),
)
TOBII_LSL = replace(
    LSL_GAZE,
    name="tobii_lsl",
    product=replace(LSL_GAZE.product, vendor="Tobii", model="Tobii by LSL"),
)
LSL_BODY = DriverSpec(
    name="lsl_body",
    kind="body tracker",
    options=LslBodyOptions,
    product=Product(model="LSL motion stream"),
    wire=Wire(medium="LSL", library=LSL, listens=LISTENS),
    remedy="start the program that sends the stream and check name, session id and firewall",
    claims=Claims(
        stands_for="any LSL motion stream", checked="genuine liblsl", unproven="other senders"
    ),
)
LSL_STREAM = DriverSpec(
    name="lsl_stream",
    kind="other",
    options=LslStreamOptions,
    product=Product(vendor="LSL", model="LSL stream"),
    wire=Wire(medium="LSL", library=LSL, listens=LISTENS),
    remedy="start the program that sends the stream and check name, type, session id and firewall",
    claims=Claims(
        stands_for="any LSL stream: EEG, skin conductance, markers",
        checked="pylsl's own outlets of numbers and of texts",
        unproven="an amplifier's own sender",
    ),
)
SPECS = (LSL_GAZE, TOBII_LSL, LSL_BODY, LSL_STREAM)

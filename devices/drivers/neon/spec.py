"""Neon: its options and its description."""

from pydantic import Field

from visavis.devices.libraries import NEON as NEON_LIBRARY
from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

REMEDY = (
    "start the Neon Companion app, put phone and computer into one network, and check the "
    "address and the ports 8080 and 8086"
)


class NeonOptions(GazeTiming, StreamOptions):
    """Options of `neon`; the scene camera is a pinhole of these pixels until it is calibrated.

    `starts_recording` lets the phone record each session, video included.
    """

    of_wire = frozenset({"address", "port"})

    address: str = Field(default="neon.local", min_length=1)
    port: int = Field(default=8080, ge=1, le=65535)
    rate_hz: float = Field(default=200.0, ge=1, le=2000)
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)
    opening_exchanges: int = Field(default=20, ge=1, le=1000)
    focal_length_px: float = Field(default=891.0, gt=0, le=10_000)
    center_x_px: float = Field(default=800.0, ge=0, le=10_000)
    center_y_px: float = Field(default=600.0, ge=0, le=10_000)
    camera_pitch_deg: float = Field(
        default=0.0, ge=-60, le=60, json_schema_extra={"any_magnitude": True}
    )
    starts_recording: bool = False


NEON = DriverSpec(
    name="neon",
    kind="eye tracker",
    options=NeonOptions,
    product=Product(
        vendor="Pupil Labs",
        model="Neon",
        capabilities=frozenset({"gaze", "per_eye", "pupil", "head_frame", "annotation"}),
    ),
    wire=Wire(medium="HTTP, RTSP", library=NEON_LIBRARY, dials=True, listens=("UDP 49152-65535",)),
    remedy=REMEDY,
    claims=Claims(
        stands_for="Pupil Labs Neon",
        checked="payloads as the vendor's client reads them; that client over HTTP, RTSP",
        unproven="newer payloads, Wi-Fi load",
    ),
)
SPECS = (NEON,)

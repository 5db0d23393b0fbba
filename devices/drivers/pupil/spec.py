"""Pupil Core: its options and its description."""

from pydantic import Field

from visavis.devices.libraries import ZMQ
from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

REMEDY = (
    "start Pupil Capture, enable the plug-in Pupil Remote on port 50020, and check address and "
    "firewall"
)


class PupilCoreOptions(GazeTiming, StreamOptions):
    """Options of `pupil_core`; `faults` and `drift_ppm` count on a simulated wire only."""

    of_wire = frozenset({"address", "port"})

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=50020, ge=1, le=65535)
    confidence_threshold_01: float = Field(default=0.6, ge=0, le=1)
    exchange_interval_s: float = Field(default=0.5, gt=0, le=60)
    opening_exchanges: int = Field(default=20, ge=1, le=1000)
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)
    reference_distance_m: float = Field(default=1.0, gt=0, le=20)


PUPIL_CORE = DriverSpec(
    name="pupil_core",
    kind="eye tracker",
    options=PupilCoreOptions,
    product=Product(
        vendor="Pupil Labs",
        model="Core",
        capabilities=frozenset({"gaze", "calibration", "annotation"}),
    ),
    wire=Wire(medium="ZeroMQ", library=ZMQ, dials=True),
    remedy=REMEDY,
    claims=Claims(
        stands_for="Pupil Labs Core, Pupil Capture 2.0 or newer",
        checked=(
            "numbers of Capture's own calibration, decoding by our reading of its code; "
            "genuine ZeroMQ"
        ),
        unproven="axes of the 3-D fields",
    ),
)
SPECS = (PUPIL_CORE,)

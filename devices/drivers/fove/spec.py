"""FOVE: its options and its description."""

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm
from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class FoveOptions(GazeTiming, StreamOptions):
    """Options of `fove`."""

    of_wire = frozenset({"library_path"})

    library_path: str = Field(default="FoveClient", min_length=1)
    eye_distance_mm: EyeDistanceMm = 64.0


FOVE = DriverSpec(
    name="fove",
    kind="eye tracker",
    options=FoveOptions,
    product=Product(
        vendor="FOVE",
        model="FOVE headset",
        capabilities=frozenset({"gaze", "per_eye", "pupil", "head_frame", "calibration"}),
    ),
    wire=Wire(medium="vendor library", runtime="fove"),
    remedy="start the FOVE runtime, connect the headset, and try again",
    claims=Claims(
        stands_for="FOVE 0",
        checked="the vendor's header FoveAPI.h; C library of our own behind ctypes",
        unproven="axes, low-accuracy code",
    ),
)
SPECS = (FOVE,)

"""Varjo: its options and its description."""

from pydantic import Field

from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class VarjoOptions(GazeTiming, StreamOptions):
    """Options of `varjo`; `smoothed` asks for the vendor's filter."""

    of_wire = frozenset({"library_path", "smoothed"})

    rate_hz: float = Field(default=200.0, ge=1, le=1000)
    library_path: str = Field(default="VarjoLib.dll", min_length=1)
    smoothed: bool = False
    exchange_interval_s: float = Field(default=1.0, gt=0, le=60)


VARJO = DriverSpec(
    name="varjo",
    kind="eye tracker",
    options=VarjoOptions,
    product=Product(
        vendor="Varjo",
        model="Varjo headset",
        capabilities=frozenset(
            {"gaze", "per_eye", "pupil", "openness", "head_frame", "calibration"}
        ),
    ),
    wire=Wire(medium="vendor library"),
    remedy=(
        "start Varjo Base, connect the headset and allow eye tracking in its settings; write the "
        "path of VarjoLib.dll under library_path"
    ),
    claims=Claims(
        stands_for="Varjo Aero, VR-3, XR-3 and XR-4, by the native SDK",
        checked=(
            "the vendor's headers of native SDK 4, laid out by a C compiler; C library of our own "
            "behind ctypes; axes as its plug-in for Unity states them"
        ),
        unproven="axes, delay, the layout in other versions, how long a calibration takes",
    ),
)
SPECS = (VARJO,)

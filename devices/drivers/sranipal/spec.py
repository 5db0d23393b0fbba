"""Vive Pro Eye: its options and its description."""

from pydantic import Field

from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class SranipalOptions(GazeTiming, StreamOptions):
    """Options of `vive_pro_eye`."""

    of_wire = frozenset({"library_path"})

    library_path: str = Field(default="SRanipal.dll", min_length=1)


VIVE_PRO_EYE = DriverSpec(
    name="vive_pro_eye",
    kind="eye tracker",
    options=SranipalOptions,
    product=Product(
        vendor="HTC",
        model="Vive Pro Eye",
        capabilities=frozenset({"gaze", "per_eye", "pupil", "openness", "head_frame"}),
    ),
    wire=Wire(medium="vendor library"),
    remedy=(
        "start SR_Runtime and SteamVR, put the headset on, allow eye tracking and calibrate in "
        "SteamVR's eye settings; write the path of SRanipal.dll under library_path"
    ),
    claims=Claims(
        stands_for="Vive Pro Eye",
        checked=(
            "our transcription of the vendor's public header, laid out by a C compiler; C library "
            "of our own behind ctypes; axes by our reading of public clients"
        ),
        unproven="axes, delay, the size of the data in other versions",
    ),
)
SPECS = (VIVE_PRO_EYE,)

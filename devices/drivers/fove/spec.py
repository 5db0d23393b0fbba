"""FOVE: its options, its wire, its simulator."""

from pydantic import Field

from visavis.devices.drivers.streaming.options import EyeDistanceMm
from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import DriverSpec, driven_by, streamed_by, wired_by


class FoveOptions(GazeTiming, StreamOptions):
    """Options of `fove`."""

    of_wire = frozenset({"library_path"})

    library_path: str = Field(default="FoveClient", min_length=1)
    eye_distance_mm: EyeDistanceMm = 64.0


FOVE = DriverSpec(
    name="fove",
    kind="eye tracker",
    options=FoveOptions,
    make=driven_by("visavis.devices.drivers.fove.driver:Fove"),
    real=wired_by("visavis.devices.drivers.fove.library:FoveLibrary", "library_path"),
    simulated=streamed_by("visavis.devices.sim.fove:FoveSimulator"),
    vendor="FOVE",
    model="FOVE headset",
    wire="vendor library",
    remedy="start the FOVE runtime, connect the headset, and try again",
    capabilities=frozenset({"gaze", "per_eye", "pupil", "head_frame", "calibration"}),
    runtime="fove",
    stands_for="FOVE 0",
    checked="our reading of the vendor's header; C library of our own behind ctypes",
    unproven="axes, low-accuracy code, layout of versions",
)
SPECS = (FOVE,)

"""FOVE: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.drivers.streaming.options import EyeDistanceMm
from devices.options import StreamOptions
from devices.spec import DriverSpec, Site, driven_by, streamed_by

if TYPE_CHECKING:
    from devices.transports import MessageTransport


class FoveOptions(StreamOptions):
    """Options of `fove`."""

    of_wire = frozenset({"library_path"})

    library_path: str = Field(default="FoveClient", min_length=1)
    eye_distance_mm: EyeDistanceMm = 64.0


Here = Site[FoveOptions]


def _client(site: Here) -> "MessageTransport":
    from devices.drivers.fove.library import FoveLibrary

    return FoveLibrary(site.options.library_path, site.clock)


FOVE = DriverSpec(
    name="fove",
    kind="eye tracker",
    options=FoveOptions,
    make=driven_by("devices.drivers.fove.driver:Fove"),
    real=_client,
    simulated=streamed_by("devices.sim.fove:FoveSimulator"),
    vendor="FOVE",
    model="FOVE headset",
    wire="vendor library",
    remedy="start the FOVE runtime, connect the headset, and try again",
    capabilities=frozenset({"gaze", "per_eye", "pupil", "head_frame", "calibration"}),
    runtime="fove",
    stands_for="FOVE 0",
    checked="C library of our own behind ctypes",
    unproven="axes, low-accuracy code, layout of versions",
)
SPECS = (FOVE,)

"""FOVE: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.drivers.streaming.options import EyeDistanceMm
from devices.options import StreamOptions
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.fove.driver import Fove
    from devices.transports import MessageTransport


class FoveOptions(StreamOptions):
    """Options of `fove`."""

    library_path: str = Field(default="FoveClient", min_length=1)
    eye_distance_mm: EyeDistanceMm = 64.0


Here = Site[FoveOptions]


def _client(site: Here) -> "MessageTransport":
    from devices.drivers.fove.library import FoveLibrary

    return FoveLibrary(site.options.library_path, site.clock)


def _simulated_client(site: Here) -> "MessageTransport":
    from devices.sim.fove import FoveSimulator

    return site.streamed(FoveSimulator, site.watched)


def _fove(site: Here, wire: "MessageTransport") -> "Fove":
    from devices.drivers.fove.driver import Fove

    return Fove(site.role, wire, site.clock, **site.options.without("library_path"))


FOVE = DriverSpec(
    name="fove",
    kind="eye tracker",
    options=FoveOptions,
    make=_fove,
    real=_client,
    simulated=_simulated_client,
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

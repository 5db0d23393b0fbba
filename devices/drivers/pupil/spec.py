"""Pupil Core: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from visavis.devices.libraries import ZMQ
from visavis.devices.options import GazeTiming, StreamOptions
from visavis.devices.spec import DriverSpec, Site, driven_by, wired_by

if TYPE_CHECKING:
    from visavis.devices.transports import MessageTransport


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


Here = Site[PupilCoreOptions]


def _simulated_capture(site: Here) -> "MessageTransport":
    """Return a simulator in memory, or on real sockets when the clock is real."""
    from visavis.devices.sim.zmq_host import ZmqHost
    from visavis.devices.transports import MemoryTransport, ZmqTransport

    simulator = site.peer("visavis.devices.sim.pupil.capture:PupilCoreSimulator")
    if site.clock.is_virtual:
        return MemoryTransport(simulator, site.clock)
    host = site.stack.enter_context(ZmqHost(simulator, site.clock))
    return ZmqTransport("127.0.0.1", host.port, site.clock, is_simulated=True)


PUPIL_CORE = DriverSpec(
    name="pupil_core",
    kind="eye tracker",
    options=PupilCoreOptions,
    make=driven_by("visavis.devices.drivers.pupil.driver:PupilCore"),
    real=wired_by("visavis.devices.transports:ZmqTransport", "address", "port"),
    simulated=_simulated_capture,
    vendor="Pupil Labs",
    model="Core",
    wire="ZeroMQ",
    remedy=REMEDY,
    capabilities=frozenset({"gaze", "calibration", "annotation"}),
    library=ZMQ,
    dials=True,
    stands_for="Pupil Labs Core, Pupil Capture 2.0 or newer",
    checked="numbers of Capture's own calibration, decoding by our reading of its code; "
    "genuine ZeroMQ",
    unproven="axes of the 3-D fields",
)
SPECS = (PUPIL_CORE,)

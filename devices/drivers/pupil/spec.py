"""Pupil Core: its options, its wire, its simulator."""

from typing import TYPE_CHECKING

from pydantic import Field

from devices.libraries import ZMQ
from devices.options import SimulatedOptions
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.pupil.driver import PupilCore
    from devices.transports import MessageTransport


REMEDY = (
    "start Pupil Capture, enable the plug-in Pupil Remote on port 50020, and check address and "
    "firewall"
)


class PupilCoreOptions(SimulatedOptions):
    """Options of `pupil_core`; `faults` and `drift_ppm` count on a simulated wire only."""

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=50020, ge=1, le=65535)
    rate_hz: float = Field(default=120.0, ge=1, le=2000)
    confidence_threshold_01: float = Field(default=0.6, ge=0, le=1)
    exchange_interval_s: float = Field(default=0.5, gt=0, le=60)
    opening_exchanges: int = Field(default=20, ge=1, le=1000)
    lost_after_s: float = Field(default=2.0, gt=0, le=60)
    eye_distance_mm: float = Field(default=64.0, ge=40, le=90)
    reference_distance_m: float = Field(default=1.0, gt=0, le=20)
    drift_ppm: float = Field(
        default=0.0, ge=-1000, le=1000, json_schema_extra={"any_magnitude": True}
    )


Here = Site[PupilCoreOptions]


def _capture(site: Here) -> "MessageTransport":
    from devices.transports import ZmqTransport

    return ZmqTransport(site.options.address, site.options.port, site.clock)


def _simulated_capture(site: Here) -> "MessageTransport":
    """Return a simulator in memory, or on real sockets when the clock is real."""
    from devices.sim.pupil.capture import PupilCoreSimulator
    from devices.sim.zmq_host import ZmqHost
    from devices.transports import MemoryTransport, ZmqTransport

    simulator = site.peer(PupilCoreSimulator, site.watched)
    if site.clock.is_virtual:
        return MemoryTransport(simulator, site.clock)
    host = site.stack.enter_context(ZmqHost(simulator, site.clock))
    return ZmqTransport("127.0.0.1", host.port, site.clock, is_simulated=True)


def _pupil_core(site: Here, wire: "MessageTransport") -> "PupilCore":
    from devices.drivers.pupil.driver import PupilCore

    return PupilCore(site.role, wire, site.clock, **site.options.without("address", "port"))


PUPIL_CORE = DriverSpec(
    name="pupil_core",
    kind="eye tracker",
    options=PupilCoreOptions,
    make=_pupil_core,
    real=_capture,
    simulated=_simulated_capture,
    vendor="Pupil Labs",
    model="Core",
    wire="ZeroMQ",
    remedy=REMEDY,
    capabilities=frozenset({"gaze", "calibration", "annotation"}),
    library=ZMQ,
    dials=True,
    stands_for="Pupil Labs Core, Pupil Capture 2.0 or newer",
    checked="genuine ZeroMQ against our server",
    unproven="axes of the 3-D fields; calibration by references",
)
SPECS = (PUPIL_CORE,)

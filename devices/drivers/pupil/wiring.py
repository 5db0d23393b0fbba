"""Pupil Core: its driver on ZeroMQ, and its simulator in memory or on real sockets."""

from visavis.devices.drivers.pupil.driver import PupilCore
from visavis.devices.drivers.pupil.spec import PUPIL_CORE, PupilCoreOptions
from visavis.devices.sim.pupil.capture import PupilCoreSimulator
from visavis.devices.sim.zmq_host import ZmqHost
from visavis.devices.transports import MemoryTransport, MessageTransport, ZmqTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streaming_peer, wired_by


def _simulated_capture(site: Site[PupilCoreOptions]) -> MessageTransport:
    """Return a simulator in memory, or on real sockets when the clock is real."""
    simulator = streaming_peer(site, PupilCoreSimulator)
    if site.clock.is_virtual:
        return MemoryTransport(simulator, site.clock)
    host = site.stack.enter_context(ZmqHost(simulator, site.clock))
    return ZmqTransport("127.0.0.1", host.port, site.clock, is_simulated=True)


WIRINGS = (
    Wiring(
        PUPIL_CORE,
        make=driven_by(PupilCore),
        real=wired_by(ZmqTransport, "address", "port"),
        simulated=_simulated_capture,
    ),
)

"""Triggers out: the driver on lines of any kind, and simulated ends of their wires."""

from typing import Any

from visavis.devices.byte_links import ByteLink
from visavis.devices.contracts import Device
from visavis.devices.drivers.links.serial_port import serial_port
from visavis.devices.drivers.links.usb import UsbLink
from visavis.devices.drivers.triggers.driver import TriggerOut, labjack, xid_lines
from visavis.devices.drivers.triggers.links import MarkerLink, ParallelLink
from visavis.devices.drivers.triggers.spec import (
    LABJACK_TRIGGERS,
    LSL_TRIGGERS,
    PARALLEL_TRIGGERS,
    SERIAL_TRIGGERS,
    XID_TRIGGERS,
    LslTriggerOptions,
    ParallelTriggerOptions,
)
from visavis.devices.sim.triggers import LabJackPeer, LinesPeer, XidLinesPeer
from visavis.devices.wiring import Site, Wiring, linked_by, spoken_by


def _triggers(site: Site[Any], link: ByteLink) -> Device:
    return TriggerOut(site.role, link, site.clock, spec=site.spec, **site.options.for_trigger())


def _labjack(site: Site[Any], link: ByteLink) -> Device:
    return labjack(site.role, link, site.clock, spec=site.spec, **site.options.for_trigger())


def _xid(site: Site[Any], link: ByteLink) -> Device:
    return xid_lines(site.role, link, site.clock, spec=site.spec, **site.options.for_trigger())


def _parallel(site: Site[ParallelTriggerOptions]) -> ByteLink:
    return ParallelLink(site.clock, site.options.port)


def _markers(site: Site[LslTriggerOptions]) -> ByteLink:
    return MarkerLink(site.clock, site.options.stream_name, site.options.source_id)


_LINES = spoken_by(LinesPeer)
WIRINGS = (
    Wiring(SERIAL_TRIGGERS, make=_triggers, real=serial_port(), simulated=_LINES),
    Wiring(XID_TRIGGERS, make=_xid, real=serial_port(), simulated=spoken_by(XidLinesPeer)),
    Wiring(PARALLEL_TRIGGERS, make=_triggers, real=_parallel, simulated=_LINES),
    Wiring(
        LABJACK_TRIGGERS,
        make=_labjack,
        real=linked_by(UsbLink, "vid", "pid", "serial_number"),
        simulated=spoken_by(LabJackPeer),
    ),
    Wiring(LSL_TRIGGERS, make=_triggers, real=_markers, simulated=_LINES),
)

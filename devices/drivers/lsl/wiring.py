"""Streams of Lab Streaming Layer: their drivers on inlets, and their simulators."""

from visavis.devices.drivers.lsl.body import LslBody
from visavis.devices.drivers.lsl.gaze import LslGaze, TobiiLsl
from visavis.devices.drivers.lsl.inlet import LslInlet
from visavis.devices.drivers.lsl.outlet import LslScope
from visavis.devices.drivers.lsl.spec import (
    LSL_BODY,
    LSL_GAZE,
    LSL_STREAM,
    TOBII_LSL,
    LslBodyOptions,
    LslGazeOptions,
    LslStreamOptions,
)
from visavis.devices.drivers.lsl.stream import LslStream
from visavis.devices.sim.lsl.body import LslBodySimulator
from visavis.devices.sim.lsl.gaze import LslGazeSimulator, TittaSimulator
from visavis.devices.sim.lsl.stream import LslStreamSimulator
from visavis.devices.transports import MessageTransport
from visavis.devices.wiring import Site, Wiring, driven_by, streamed_by


def _inlet(site: Site[LslGazeOptions] | Site[LslStreamOptions]) -> MessageTransport:
    options = site.options
    session = options.session_id
    return LslInlet(
        site.clock,
        name=options.stream_name,
        content_type=options.stream_type,
        source_id=options.source_id,
        configuration=LslScope(session).configuration() if session else "",
    )


def _body_inlet(site: Site[LslBodyOptions]) -> MessageTransport:
    options = site.options
    return LslInlet(
        site.clock, name=options.name, content_type="MoCap", source_id=options.source_id
    )


WIRINGS = (
    Wiring(
        LSL_GAZE,
        make=driven_by(LslGaze),
        real=_inlet,
        simulated=streamed_by(LslGazeSimulator),
    ),
    Wiring(
        TOBII_LSL,
        make=driven_by(TobiiLsl),
        real=_inlet,
        simulated=streamed_by(TittaSimulator),
    ),
    Wiring(
        LSL_BODY,
        make=driven_by(LslBody),
        real=_body_inlet,
        simulated=streamed_by(LslBodySimulator),
    ),
    Wiring(
        LSL_STREAM,
        make=driven_by(LslStream),
        real=_inlet,
        simulated=streamed_by(LslStreamSimulator),
    ),
)

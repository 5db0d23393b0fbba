"""Streams of Lab Streaming Layer: options, wires, simulators."""

from dataclasses import replace
from typing import TYPE_CHECKING

from pydantic import Field

from devices.drivers.streaming.options import SCREEN_NAMES, EyeDistanceMm, ScreenOptions
from devices.libraries import LSL
from devices.options import StreamOptions
from devices.spec import DriverSpec, Site

if TYPE_CHECKING:
    from devices.drivers.lsl.body import LslBody
    from devices.drivers.lsl.gaze import LslGaze
    from devices.transports import MessageTransport

LISTENS = ("UDP 16571-16604", "TCP 16572-16604")
GAZE_REMEDY = (
    "start the program that sends the gaze stream, on this network and in the same LSL session, "
    "and check the firewall"
)
GAZE_WIRE = ("stream_name", "stream_type", "source_id", "session_id")


class LslGazeOptions(ScreenOptions):
    """Options of `lsl_gaze` and `tobii_lsl`; empty names match any stream of the type."""

    stream_name: str = ""
    stream_type: str = "Gaze"
    source_id: str = ""
    session_id: str = ""
    exchange_interval_s: float = Field(default=5.0, gt=0, le=600)
    eye_distance_mm: EyeDistanceMm = 64.0


class LslBodyOptions(StreamOptions):
    """Options of `lsl_body`: which stream, and the stream's object -> segment."""

    name: str = ""
    source_id: str = ""
    objects: dict[str, str] = Field(default_factory=dict)
    rate_hz: float = Field(default=60.0, ge=1, le=2000)


GazeSite = Site[LslGazeOptions]
BodySite = Site[LslBodyOptions]


def _gaze_inlet(site: GazeSite) -> "MessageTransport":
    from devices.drivers.lsl.inlet import LslInlet
    from devices.drivers.lsl.outlet import LslScope

    options = site.options
    session = options.session_id
    return LslInlet(
        site.clock,
        name=options.stream_name,
        content_type=options.stream_type,
        source_id=options.source_id,
        configuration=LslScope(session).configuration() if session else "",
    )


def _simulated_gaze(site: GazeSite) -> "MessageTransport":
    from devices.sim.lsl.gaze import LslGazeSimulator

    return site.streamed(LslGazeSimulator, site.watched, screen=site.options.screen())


def _simulated_tobii(site: GazeSite) -> "MessageTransport":
    from devices.sim.lsl.gaze import LslGazeSimulator

    screen = site.options.screen()
    return site.streamed(LslGazeSimulator, site.watched, screen=screen, layout="titta")


def _lsl_gaze(site: GazeSite, wire: "MessageTransport") -> "LslGaze":
    from devices.drivers.lsl.gaze import LslGaze

    options = site.options.without(*GAZE_WIRE, *SCREEN_NAMES)
    screen = site.options.screen()
    return LslGaze(site.role, wire, site.clock, spec=site.spec, screen=screen, **options)


def _body_inlet(site: BodySite) -> "MessageTransport":
    from devices.drivers.lsl.inlet import LslInlet

    options = site.options
    return LslInlet(
        site.clock, name=options.name, content_type="MoCap", source_id=options.source_id
    )


def _simulated_body(site: BodySite) -> "MessageTransport":
    from devices.sim.lsl.body import LslBodySimulator

    return site.streamed(LslBodySimulator, site.moving, objects=site.options.objects)


def _lsl_body(site: BodySite, wire: "MessageTransport") -> "LslBody":
    from devices.drivers.lsl.body import LslBody

    return LslBody(site.role, wire, site.clock, **site.options.without("name", "source_id"))


LSL_GAZE = DriverSpec(
    name="lsl_gaze",
    kind="eye tracker",
    options=LslGazeOptions,
    make=_lsl_gaze,
    real=_gaze_inlet,
    simulated=_simulated_gaze,
    vendor="LSL",
    model="LSL gaze stream",
    wire="LSL",
    remedy=GAZE_REMEDY,
    capabilities=frozenset({"gaze", "pupil"}),
    library=LSL,
    listens=LISTENS,
    stands_for="any LSL gaze stream; TittaLSL",
    checked="genuine liblsl; labels in memory",
    unproven="other senders' meta-data; a Tobii Pro",
)
TOBII_LSL = replace(
    LSL_GAZE,
    name="tobii_lsl",
    simulated=_simulated_tobii,
    vendor="Tobii",
    model="Tobii by LSL",
)
LSL_BODY = DriverSpec(
    name="lsl_body",
    kind="body tracker",
    options=LslBodyOptions,
    make=_lsl_body,
    real=_body_inlet,
    simulated=_simulated_body,
    model="LSL motion stream",
    wire="LSL",
    remedy="start the program that sends the stream and check name, session id and firewall",
    library=LSL,
    listens=LISTENS,
    stands_for="any LSL motion stream",
    checked="genuine liblsl",
    unproven="other senders",
)
SPECS = (LSL_GAZE, TOBII_LSL, LSL_BODY)

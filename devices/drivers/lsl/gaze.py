"""Drive any eye tracker that an LSL gaze stream offers, such as Tobii trackers by TittaLSL.

Codec: `visavis.devices.drivers.lsl.gaze_codec`. Transport:
`visavis.devices.drivers.lsl.inlet.LslInlet`. The device's time is the sender's raw stamp; offsets
are LSL's own measurements, all kept. LSL does not number samples, so lost samples show only in the
spacing of the stamps.
"""

from collections.abc import Iterable
from dataclasses import replace

from visavis.devices.drivers.lsl import gaze_codec as codec
from visavis.devices.drivers.lsl.inlet import read_offset
from visavis.devices.drivers.lsl.spec import LSL_GAZE, TOBII_LSL
from visavis.devices.drivers.streaming.gaze_device import GazeDevice
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.spec import AnySpec
from visavis.devices.transports import Frames, Message, MessageTransport
from visavis.lab.clock import Clock
from visavis.lab.errors import ProtocolViolation
from visavis.lab.schema import StreamSchema


class LslGaze(GazeDevice):
    """Follow the `EyeTracker` contract over an LSL stream with XDF gaze meta-data.

    Streams of points on a screen use `screen`; directions must be in the head frame. The rate is
    the stream's own where it states one.
    """

    spec: AnySpec = LSL_GAZE

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        rate_hz: float = 120.0,
        lost_after_s: float = 2.0,
        exchange_interval_s: float = 5.0,
        screen: Screen | None = None,
        eye_distance_mm: float = 64.0,
        screen_px: tuple[int, int] = (1920, 1080),
    ) -> None:
        self._screen = screen or Screen()
        self._screen_px = screen_px
        self._half_m = eye_distance_mm * 5e-4
        self._layout: codec.GazeLayout | None = None
        super().__init__(
            role,
            transport,
            clock,
            self.spec,
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
            exchange_interval_s=exchange_interval_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        self._layout = None
        info = codec.parse_info(self._ask((b"info",), deadline_ns).frames[1])
        layout = None if info is None else codec.layout_of(info, self._screen_px)
        if info is None or layout is None:
            raise ProtocolViolation(
                "the stream names no gaze channels",
                role=self.info.role,
                remedy="let its sender follow the XDF gaze meta-data: type, eye and unit of each",
            )
        codec.require_rate(info)
        self._layout = layout
        capabilities = {"gaze", "screen_frame" if layout.on_screen else "head_frame"}
        if layout.per_eye:
            capabilities.add("per_eye")
        if any(kind == codec.PUPIL for _, kind in layout.places):
            capabilities.add("pupil")
        self.info = replace(
            self.info,
            model=info.name or self.info.model,
            serial=info.source_id,
            capabilities=frozenset(capabilities),
        )
        if info.rate_hz > 0:
            schema = self._schema
            self._schema = StreamSchema(schema.name, schema.fields, info.rate_hz, schema.version)
        frame = self._warning(
            "the stream does not say that its directions are in the head frame; taken as such",
            "let its sender state coordinate_system head-space",
        )
        self._note("frame", None if layout.states_frame else frame)
        exchange = self._ask((b"time",), deadline_ns)
        self._take_offset(exchange.frames, exchange.t_receive_ns)

    def _ask_time(self, now_ns: int) -> None:
        self._transport.post((b"time",))

    def _decode(self, message: Message) -> Iterable[Sample]:
        frames, layout = message.frames, self._layout
        if message.t_sent_ns is not None:
            self._take_offset(frames, message.t_host_ns)
            return
        sample = None
        if len(frames) == 2 and layout is not None:
            sample = codec.decode_sample(frames[1], layout, self._screen, self._half_m)
        if sample is None:
            self._malformed += 1
        else:
            yield sample

    def _take_offset(self, frames: Frames, t_host_ns: int) -> None:
        pair = read_offset(frames, t_host_ns)
        if pair is None:
            self._malformed += 1
        else:
            self._add_pair(pair)


class TobiiLsl(LslGaze):
    """A Tobii tracker sent by TittaLSL: the same driver under the tracker's name."""

    spec = TOBII_LSL

"""Drive a headset through an OpenXR runtime: pace, poses and, once asked for, images.

`show_images` before `open` makes it a session with graphics, in the OpenGL context that is then
current; otherwise it is headless and refuses images. The pose of a frame is the runtime's
prediction for the frame's light, with the view space's origin taken as the midpoint between the
eyes. Images are handed over with the pose and the views they were drawn from. OpenXR has no frame
timing: frames that the display went on without are told from its own display times. All of it
belongs to the thread that draws.
"""

import math
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import msgpack
import numpy as np

from devices.contracts import (
    FRAME_TIMING,
    HEAD,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.openxr.graphics import packed_images
from devices.drivers.openxr.packing import FRAME
from devices.drivers.openxr.spec import OPENXR_HEADSET
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.transports import MessageTransport
from lab.clock import NS_PER_S, Clock
from lab.errors import DeviceDisconnected, DeviceError, ProtocolViolation
from lab.frame import EyeView, FrameInfo
from lab.geometry import Vector, quat_multiply, rotate
from lab.schema import SampleBatch, StreamSchema

REMEDY = "look at the OpenXR runtime; start it again if it is not running"
VALID = 0b0011
TRACKED = 0b1100
RECONNECT_EVERY_NS = NS_PER_S // 2
CALL_TIMEOUT_S = 5.0
USUAL_EYE_PX = (1440, 1600)
"""Until the runtime has been asked; only a session with graphics asks."""

_HEAD_ROW = struct.Struct("<3f4f?")
_LOST_ROW = _HEAD_ROW.pack(*[math.nan] * 7, False)


class OpenXrHeadset:
    """Follow the `Headset` contract; streams are `HEAD` and `FRAME_TIMING`."""

    def __init__(
        self, role: str, transport: MessageTransport, clock: Clock, *, display_rate_hz: float = 90
    ) -> None:
        self.display_rate_hz = float(display_rate_hz)
        self.render_size_px = USUAL_EYE_PX
        self._transport = transport
        self._clock = clock
        self._life = Lifecycle(role)
        self._views: tuple[EyeView, EyeView] | None = None
        self._sink: Sink | None = None
        self._pending: deque[SampleBatch] = deque()
        self._retry_ns = 0
        self._lost = self._refused = ""
        self._shows_images = self._unfocused = False
        self.info = OPENXR_HEADSET.info(role, transport)
        self._reset()

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the session is lost."""
        return self._life.state

    def show_images(self) -> None:
        """Begin the coming session with graphics; the context is current when it is opened."""
        self._life.require("show_images", DeviceState.CLOSED)
        self._transport.post((b"images",))
        self._shows_images = True
        self.info = replace(self.info, capabilities=self.info.capabilities | {"display"})

    def open(self, deadline_s: float) -> None:
        """Begin the session, read the views and one frame's period."""
        self._life.require("open", DeviceState.CLOSED)
        try:
            self._transport.open(deadline_s)
            name = msgpack.unpackb(self._answer("runtime"))[0]
            self._learn_views()
            if self._shows_images:
                width, height = msgpack.unpackb(self._answer("size"))
                self.render_size_px = (int(width), int(height))
            period_ns = FRAME.unpack(self._answer("frame"))[3]
        except DeviceError as problem:
            self._transport.close()
            if problem.role:
                raise
            raise type(problem)(str(problem), role=self.info.role) from problem
        if period_ns > 0:
            self.display_rate_hz = NS_PER_S / period_ns
        self.info = replace(
            self.info,
            model=f"OpenXR headset ({name})",
            is_simulated=self._transport.is_simulated,
        )
        self._reset()
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the head stream and the frame timing, at the display's rate."""
        return (self._head_schema, self._timing_schema)

    def eye_views(self) -> tuple[EyeView, EyeView]:
        """Return how the left and the right eye look; known once open."""
        if self._views is None:
            raise DeviceError(
                "the views are known once it is open", role=self.info.role, remedy="call open()"
            )
        return self._views

    def start(self, sink: Sink) -> None:
        """Begin counting frames anew."""
        self._life.require("start", DeviceState.OPEN)
        self._sink = sink
        self._reset()
        self._life.state = DeviceState.STREAMING

    def wait_frame(self) -> FrameInfo:
        """Block until the runtime lets the next frame begin, and locate the head in it."""
        if self._life.state is DeviceState.STREAMING:
            exchange = self._transport.request((b"frame",), CALL_TIMEOUT_S)
            self._clock.sleep_until_ns(exchange.t_receive_ns)  # a replay has yet to get there
            error, *rest = exchange.frames
            if not error and rest and len(rest[0]) == FRAME.size:
                self._unfocused = rest[1:] == [b"0"]
                return self._begin(FRAME.unpack(rest[0]), exchange.t_receive_ns)
            self._lost = f"lost the OpenXR session: {error.decode() or 'an unreadable answer'}"
            self._life.state = DeviceState.FAULT
        self._life.require("wait_frame", DeviceState.STREAMING, DeviceState.FAULT)
        t_ns = self._last_t_ns + self._period_ns
        skipped = max(0, (self._clock.now_ns() - t_ns) // self._period_ns)
        t_ns += skipped * self._period_ns
        self._clock.sleep_until_ns(t_ns)
        return self._frame_at(t_ns, t_ns + self._period_ns, skipped, _LOST_ROW)

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Hand over one GL texture per eye, left first, same size; none shows nothing new.

        Raises:
            DeviceError: the session is headless, or the runtime refuses an image.
        """
        self._life.require("submit", DeviceState.STREAMING, DeviceState.FAULT)
        if not self._shows_images:
            if images:
                raise DeviceError(
                    "a headless OpenXR session shows no images",
                    role=self.info.role,
                    remedy="set display.show to headset (or offscreen) in lab_config.yaml",
                )
            return
        if self._life.state is DeviceState.FAULT:
            return
        request = (b"show", self._packed(images)) if images else (b"show",)
        error = self._transport.request(request, CALL_TIMEOUT_S).frames[0].decode()
        if error and images:
            self._refused = error
            raise DeviceError(
                f"the runtime refused the images: {error}",
                role=self.info.role,
                remedy="hand over two RGBA8 textures of the context that was current when the "
                f"session was opened; {REMEDY}",
            )
        if images:
            self._refused = ""
            self._submitted_ns = self._clock.now_ns()

    def poll(self, timeout_s: float) -> int:
        """Hand over the frames since the last call; while the session is lost, try again."""
        life = self._life
        if life.state is not DeviceState.STREAMING:
            life.require("poll", DeviceState.STREAMING, DeviceState.FAULT)
        delivered = 0
        while self._pending and self._sink is not None:
            batch = self._pending.popleft()
            if batch.schema is self._head_schema:
                self._meter.update(batch.t_device_ns.tolist(), int(batch.t_host_ns[-1]))
            else:
                self._timing_rows += 1
            self._sink(batch)
            delivered += 1
        if life.state is DeviceState.FAULT:
            self._reconnect()
            if self.state is DeviceState.FAULT and not delivered:
                raise DeviceDisconnected(self._lost, role=self.info.role, remedy=REMEDY)
        return delivered

    def stop(self) -> None:
        """Stop delivering; the session stays."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """End the session; idempotent."""
        self._sink = None
        self._pending.clear()
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report the rows of both streams; rate and gaps are the head's."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, received=health.received + self._timing_rows)

    def check(self) -> tuple[Fault, ...]:
        """Tell a lost session, lost tracking, a lost focus and refused images."""
        role = self.info.role
        if self.state is DeviceState.FAULT:
            return (Fault(role, "blocking", self._lost, REMEDY),)
        if self._refused:
            text = f"images were refused: {self._refused}"
            return (Fault(role, "blocking", text, REMEDY),)
        faults = []
        if self._untracked:
            remedy = "put the headset on and check its tracking"
            faults.append(Fault(role, "blocking", "the headset is not tracked", remedy))
        if self._unfocused:
            remedy = "close the runtime's menu and other VR programs; put the headset on"
            text = "the session has not got the focus: participants see something else"
            faults.append(Fault(role, "blocking", text, remedy))
        return tuple(faults)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: the runtime's times are converted to this computer's clock."""
        return ()

    # ---- private --------------------------------------------------------------------------

    def _reset(self) -> None:
        rate_hz = self.display_rate_hz
        self._period_ns = round(NS_PER_S / rate_hz)
        self._head_schema = StreamSchema(HEAD.name, HEAD.fields, rate_hz, HEAD.version)
        self._timing_schema = StreamSchema(
            FRAME_TIMING.name, FRAME_TIMING.fields, rate_hz, FRAME_TIMING.version
        )
        self._meter = StreamMeter(rate_hz)
        self._timing_rows = 0
        self._pending.clear()
        self._index = self._seq = -1
        self._timing: tuple[FrameInfo, int] | None = None
        self._timing_seq = 0
        self._submitted_ns = -1
        self._drawn_from: tuple[Vector, Vector] = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        self._last_t_ns = self._clock.now_ns() - 1
        self._last_display: int | None = None
        self._untracked = False

    def _answer(self, name: str) -> bytes:
        frames = self._transport.request((name.encode(),), CALL_TIMEOUT_S).frames
        if frames[0] or len(frames) < 2:
            reason = frames[0].decode() or "an empty answer"
            raise ProtocolViolation(f"the runtime refused {name!r}: {reason}", remedy=REMEDY)
        return frames[1]

    def _learn_views(self) -> None:
        rows = msgpack.unpackb(self._answer("views"))
        if len(rows) != 2:
            raise ProtocolViolation(f"the runtime has {len(rows)} views, not 2", remedy=REMEDY)
        left, right = (
            EyeView(
                (row[0], row[1], row[2]),
                (row[6], row[3], row[4], row[5]),
                *(math.tan(angle) for angle in row[7:11]),
            )
            for row in rows
        )
        self._views = (left, right)

    def _begin(self, numbers: tuple[float, ...], t_receive_ns: int) -> FrameInfo:
        _host_ns, now, display, period = (int(n) for n in numbers[:4])
        flags, x, y, z, i, j, k, w = int(numbers[4]), *numbers[5:]
        t_ns = max(t_receive_ns, self._last_t_ns + 1)
        # Both stamps are of one instant; on a replay the whole log is moved in time.
        predicted_ns = max(t_ns, t_ns + display - now)
        skipped = 0
        if self._last_display is not None and period > 0:
            skipped = max(0, round((display - self._last_display) / period) - 1)
        self._last_display = display
        length = math.sqrt(w * w + i * i + j * j + k * k)
        good = flags & VALID == VALID and flags & TRACKED == TRACKED and 0.9 < length < 1.1
        row = _LOST_ROW
        if good:
            turn = (w / length, i / length, j / length, k / length)
            row = _HEAD_ROW.pack(x, y, z, *turn, True)
            drawn_from = np.array((x, y, z, *turn), np.float32).astype(np.float64)
            self._drawn_from = (drawn_from[:3], drawn_from[3:])
        return self._frame_at(t_ns, predicted_ns, skipped, row)

    def _frame_at(self, t_ns: int, predicted_ns: int, skipped: int, row: bytes) -> FrameInfo:
        self._close_frame()
        self._index += 1 + skipped
        self._seq += 1
        self._last_t_ns = t_ns
        self._untracked = row is _LOST_ROW
        self._deliver(self._head_schema, self._seq, predicted_ns, t_ns, row)
        frame = FrameInfo(self._index, t_ns, predicted_ns, skipped)
        self._timing = (frame, self._seq)
        return frame

    def _close_frame(self) -> None:
        """Tell what became of the frame before."""
        if self._timing is None:
            return
        (frame, pose_seq), self._timing = self._timing, None
        row = np.zeros(1, FRAME_TIMING.dtype)
        row["frame"], row["pose_seq"] = frame.index, pose_seq
        row["predicted_display_ns"] = frame.predicted_display_ns
        row["t_submitted_ns"], self._submitted_ns = self._submitted_ns, -1
        row["skipped"], row["render_gpu_ms"] = frame.dropped, math.nan
        schema, told_ns = self._timing_schema, self._clock.now_ns()
        seq, self._timing_seq = self._timing_seq, self._timing_seq + 1
        self._deliver(schema, seq, frame.predicted_display_ns, told_ns, row.tobytes())

    def _deliver(
        self, schema: StreamSchema, seq: int, t_device_ns: int, t_host_ns: int, row: bytes
    ) -> None:
        self._pending.append(
            SampleBatch(
                schema,
                np.array((seq,), np.int64),
                np.array((t_device_ns,), np.int64),
                np.array((t_host_ns,), np.int64),
                np.frombuffer(row, schema.dtype),
            )
        )

    def _packed(self, images: Sequence[object]) -> bytes:
        """Return two images with the place and the view each was drawn from."""
        views = self.eye_views()
        names = [int(getattr(image, "glo", image)) for image in images]  # type: ignore[call-overload]  # int or texture
        sizes = {tuple(getattr(image, "size", ())) for image in images}
        if len(names) != len(views) or len(sizes) != 1 or () in sizes:
            raise DeviceError(
                f"a headset takes two textures of one size, not {len(names)} of {len(sizes)}",
                role=self.info.role,
                remedy="draw both eyes, or hand over none",
            )
        place, turn = self._drawn_from
        width, height = sizes.pop()
        poses = [
            (
                (place + rotate(turn, np.asarray(view.offset_m))).tolist(),
                quat_multiply(turn, np.asarray(view.orientation_wxyz)).tolist(),
            )
            for view in views
        ]
        return packed_images(names, (width, height), poses, views)

    def _reconnect(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_ns:
            return
        self._retry_ns = now_ns + RECONNECT_EVERY_NS
        try:
            self._transport.open(0.2)
            self._learn_views()
        except DeviceError as problem:
            self._lost = f"lost the OpenXR session: {problem}"
            return
        self._last_display = None
        self._life.state = DeviceState.STREAMING

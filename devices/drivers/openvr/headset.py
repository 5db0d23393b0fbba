"""Drive a headset through an OpenVR runtime (SteamVR): pace, poses, submission, frame truth.

Codec: `devices.drivers.openvr.codec`. Wire: `devices.drivers.openvr.library`, a `.wire` replay,
or any `MessageTransport` with the same requests. The pose of a frame is the runtime's prediction
for that frame's light; its `t_device_ns` is `predicted_display_ns`. All of it, `wait_frame` and
`submit` included, belongs to the thread that draws.
"""

import math
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from devices.contracts import (
    FRAME_TIMING,
    HEAD,
    ClockPair,
    DeviceState,
    Fault,
    Health,
    Sink,
)
from devices.drivers.openvr import codec
from devices.drivers.openvr.display import BaseStations, read_display, timing_row
from devices.drivers.openvr.findings import COMPOSITOR_REMEDIES, FOCUS_LOST, REMEDY, Findings
from devices.drivers.openvr.spec import OPENVR_HEADSET
from devices.lifecycle import Lifecycle
from devices.meter import StreamMeter
from devices.transports import Exchange, MessageTransport
from lab.clock import NS_PER_S, Clock
from lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound
from lab.frame import EyeView, FrameInfo
from lab.geometry import Pose, rotate
from lab.schema import SampleBatch, StreamSchema

BASE_STATIONS_EVERY_NS = 2 * NS_PER_S
RECONNECT_EVERY_NS = NS_PER_S // 2
CALL_TIMEOUT_S = 5.0

Array = npt.NDArray[Any]

_HEAD_ROW = struct.Struct("<3f4f?")
_LOST_ROW = _HEAD_ROW.pack(*[math.nan] * 7, False)


class OpenVrHeadset:
    """Follow the `Headset` contract over an OpenVR runtime.

    Streams: the head (`HEAD`) and what became of every frame (`FRAME_TIMING`). While the runtime
    is gone `wait_frame` keeps the pace by the clock with invalid poses, and `poll` raises
    DeviceDisconnected until it is back. `display_rate_hz` and the views are known once open.
    """

    def __init__(self, role: str, transport: MessageTransport, clock: Clock) -> None:
        self._transport = transport
        self._clock = clock
        self._life = Lifecycle(role)
        self.display_rate_hz = HEAD.nominal_rate_hz
        self.render_size_px = (0, 0)
        self._photons_ns = 0
        self._views: tuple[EyeView, EyeView] | None = None
        self._midpoint = np.zeros(3)
        self._sink: Sink | None = None
        self._pending: deque[SampleBatch] = deque()
        self._found = Findings()
        self._lost = ""
        self._retry_ns = 0
        self._serials: dict[int, str] = {}
        self._bases = BaseStations()
        self._base_due_ns = 0
        self._last_poses = codec.decode_poses(b"")
        self.info = OPENVR_HEADSET.info(role, transport)
        self._reset()

    @property
    def state(self) -> DeviceState:
        """Where it is in its life; FAULT while the runtime is gone."""
        return self._life.state

    def open(self, deadline_s: float) -> None:
        """Connect to the runtime and read what it says of headset, display and views."""
        self._life.require("open", DeviceState.CLOSED)
        try:
            self._transport.open(deadline_s)
            self._learn()
        except DeviceError as problem:
            self._transport.close()
            if problem.role:
                raise
            raise type(problem)(str(problem), role=self.info.role) from problem
        self._life.state = DeviceState.OPEN

    def describe(self) -> tuple[StreamSchema, ...]:
        """Return the head stream and the frame timing, at the display's rate."""
        return (self._head_schema, self._timing_schema)

    def eye_views(self) -> tuple[EyeView, EyeView]:
        """Return how the left and the right eye look through the display; known once open."""
        if self._views is None:
            raise DeviceError(
                "the views are known once it is open", role=self.info.role, remedy="call open()"
            )
        return self._views

    def start(self, sink: Sink) -> None:
        """Begin counting frames anew."""
        self._life.require("start", DeviceState.OPEN)
        self._transport.receive(0.0)
        self._sink = sink
        self._reset()
        self._life.state = DeviceState.STREAMING

    def wait_frame(self) -> FrameInfo:
        """Block until the runtime lets the next frame begin; take its poses and timing."""
        if self._life.state is DeviceState.FAULT:
            return self._wait_without_runtime()
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("wait_frame", DeviceState.STREAMING)
        exchange = self._call("wait_poses")
        self._clock.sleep_until_ns(exchange.t_receive_ns)  # a replay has yet to get there
        error = exchange.frames[0].decode()
        self._found.unfocused = error == FOCUS_LOST
        if error and not self._found.unfocused:
            self._lose(error)
            return self._wait_without_runtime()
        t_ns = max(exchange.t_receive_ns, self._last_t_ns + 1)
        known, since_ns, count = self._vsync(exchange, t_ns)
        skipped = self._skipped(known, count, t_ns)
        self._close_frame(exchange.frames[3] if len(exchange.frames) > 3 else b"")
        predicted_ns = t_ns - since_ns + self._period_ns + self._photons_ns
        poses = codec.decode_poses(exchange.frames[1] if len(exchange.frames) > 1 else b"")
        return self._begin_frame(t_ns, max(predicted_ns, t_ns), skipped, poses)

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Hand over one GL texture name per eye, left first; none shows nothing new.

        Raises DeviceError with the remedy when the runtime refuses an image, except when it only
        says that another program has the focus; `check` tells that.
        """
        self._life.require("submit", DeviceState.STREAMING, DeviceState.FAULT)
        if not images or self._life.state is DeviceState.FAULT:
            return
        if len(images) != 2:
            raise DeviceError(
                f"a headset takes two images, not {len(images)}",
                role=self.info.role,
                remedy="draw both eyes, or hand over none",
            )
        for eye, image in enumerate(images):
            name = int(getattr(image, "glo", image))  # type: ignore[call-overload]  # int or texture
            frames = (f"submit {eye}".encode(), str(name).encode())
            error = self._transport.request(frames, CALL_TIMEOUT_S).frames[0].decode()
            if error == FOCUS_LOST:
                self._found.unfocused = True
            elif error:
                self._found.submit_problem = error
                raise DeviceError(
                    f"the runtime refused the {('left', 'right')[eye]} image: {error}",
                    role=self.info.role,
                    remedy=COMPOSITOR_REMEDIES.get(error, REMEDY),
                )
        self._found.submit_problem = ""
        self._submitted_ns = self._clock.now_ns()

    def poll(self, timeout_s: float) -> int:
        """Hand over the frames since the last call and take the runtime's events.

        `timeout_s` counts for nothing: the frames come from `wait_frame` in this same thread.
        """
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
        for message in self._transport.receive(0.0):
            event = codec.decode_event(message.frames[-1])
            if event is not None:
                self._take_event(event)
        if self.state is DeviceState.FAULT and not delivered:
            raise DeviceDisconnected(self._lost, role=self.info.role, remedy=REMEDY)
        return delivered

    def stop(self) -> None:
        """Stop delivering; the runtime stays connected."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Leave the runtime; idempotent."""
        self._sink = None
        self._pending.clear()
        self._transport.close()
        self._life.state = DeviceState.CLOSED

    def health(self) -> Health:
        """Report the rows of both streams; rate and gaps are the head's."""
        health = self._meter.health(self.state, self._clock.now_ns())
        return replace(health, received=health.received + self._timing_rows)

    def check(self) -> tuple[Fault, ...]:
        """Tell standby, a headset not worn, lost tracking, moved base stations, lost focus."""
        lost = self._lost if self.state is DeviceState.FAULT else ""
        return self._found.faults(self.info.role, lost, self._bases.moved_m)

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: the runtime stamps by this computer's clock."""
        return ()

    def poses_by_serial(self) -> dict[str, Pose | None]:
        """Return where every device stood in the present frame, None where it was not tracked."""
        found: dict[str, Pose | None] = {}
        for slot, serial in self._serials.items():
            pose = codec.decode_pose(self._last_poses[slot]) if len(self._last_poses) else None
            found[serial] = None if pose is None else Pose(np.array(pose[0]), np.array(pose[1]))
        return found

    # ---- private --------------------------------------------------------------------------

    def _reset(self) -> None:
        rate_hz = self.display_rate_hz
        self._head_schema = StreamSchema(HEAD.name, HEAD.fields, rate_hz, HEAD.version)
        self._timing_schema = StreamSchema(
            FRAME_TIMING.name, FRAME_TIMING.fields, rate_hz, FRAME_TIMING.version
        )
        self._period_ns = round(NS_PER_S / rate_hz)
        self._meter = StreamMeter(rate_hz)
        self._timing_rows = 0
        self._pending.clear()
        self._index = -1
        self._seq = 0
        self._timing_seq = 0
        self._last_t_ns = self._clock.now_ns() - 1
        self._last_count: int | None = None
        self._frame: FrameInfo | None = None
        self._submitted_ns = -1
        self._found.untracked = False

    def _call(self, name: str) -> Exchange:
        return self._transport.request((name.encode(),), CALL_TIMEOUT_S)

    def _answer(self, name: str) -> bytes:
        frames = self._call(name).frames
        error = frames[0].decode()
        if error or len(frames) < 2:
            raise DeviceNotFound(
                f"the runtime refused {name!r}: {error or 'an empty answer'}",
                role=self.info.role,
                remedy=REMEDY,
            )
        return frames[1]

    def _learn(self) -> None:
        runtime = self._answer("runtime").decode("utf-8", "replace")
        self._learn_devices()
        eyes = (self._answer("eye 0"), self._answer("eye 1"))
        found = read_display(self._answer("display"), eyes, role=self.info.role, remedy=REMEDY)
        self.display_rate_hz, self.render_size_px = found.rate_hz, found.render_size_px
        self._photons_ns, self._midpoint = found.photons_ns, found.midpoint_m
        self._views = found.views
        self.info = replace(
            self.info, is_simulated=self._transport.is_simulated, driver_version=f"1 ({runtime})"
        )
        self._reset()

    def _learn_devices(self) -> None:
        rows = msgpack.unpackb(self._answer("devices"))
        self._serials = {row[0]: row[3] for row in rows}
        self._bases.slots = {row[0]: row[3] for row in rows if row[1] == codec.BASE_STATION}
        for _, kind, _, serial, model, maker, _ in rows:
            if kind == codec.HMD:
                self.info = replace(self.info, serial=serial, model=model, vendor=maker)

    def _vsync(self, exchange: Exchange, t_ns: int) -> tuple[bool, int, int]:
        raw = exchange.frames[2] if len(exchange.frames) > 2 else b""
        if len(raw) != codec.VSYNC.size:
            return False, 0, 0
        known, since_s, count = codec.VSYNC.unpack(raw)
        if not known or not 0 <= since_s < 1:
            return False, 0, 0
        return True, round(since_s * NS_PER_S), int(count)

    def _skipped(self, known: bool, count: int, t_ns: int) -> int:
        before, self._last_count = self._last_count, count if known else None
        if self._frame is None:
            return 0
        if known and before is not None and 0 < count - before < 2**31:
            return count - before - 1
        return max(0, round((t_ns - self._last_t_ns) / self._period_ns) - 1)

    def _begin_frame(self, t_ns: int, predicted_ns: int, skipped: int, poses: Array) -> FrameInfo:
        self._index += 1 + skipped
        self._last_t_ns = t_ns
        self._last_poses = poses
        self._submitted_ns = -1
        pose = codec.decode_pose(poses[0]) if len(poses) else None
        self._found.untracked = pose is None
        if pose is None:
            row = _LOST_ROW
        else:
            place = np.array(pose[0]) + rotate(np.array(pose[1]), self._midpoint)
            row = _HEAD_ROW.pack(*place.tolist(), *pose[1], True)
        self._deliver(self._head_schema, self._seq, predicted_ns, t_ns, row)
        self._frame = FrameInfo(self._index, t_ns, predicted_ns, skipped)
        self._seq += 1
        if t_ns >= self._base_due_ns:
            self._base_due_ns = t_ns + BASE_STATIONS_EVERY_NS
            self._bases.look(poses)
        return self._frame

    def _close_frame(self, timing_raw: bytes) -> None:
        frame = self._frame
        if frame is None:
            return
        row = timing_row(frame, self._seq - 1, self._submitted_ns, timing_raw)
        self._deliver(
            self._timing_schema,
            self._timing_seq,
            frame.predicted_display_ns,
            self._clock.now_ns(),
            row,
        )
        self._timing_seq += 1

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

    def _take_event(self, event: codec.VrEvent) -> None:
        if event.kind == "quit":
            self._lose("the runtime was closed")
        elif event.kind in ("standby", "awake"):
            self._found.standby = event.kind == "standby"
        elif event.slot == 0 and event.kind in ("worn", "taken_off"):
            self._found.taken_off = event.kind == "taken_off"
        elif event.slot == 0 and event.button == "worn":
            self._found.taken_off = event.kind == "release"
        elif event.kind in ("activated", "deactivated") and self.state is DeviceState.STREAMING:
            self._learn_devices()

    def _lose(self, reason: str) -> None:
        self._lost = f"lost the OpenVR runtime: {reason}"
        self._life.state = DeviceState.FAULT

    def _wait_without_runtime(self) -> FrameInfo:
        """Keep the pace by the clock, so that the session can pause and the loop goes on."""
        self._close_frame(b"")
        self._last_count = None
        t_ns = self._last_t_ns + self._period_ns
        now_ns = self._clock.now_ns()
        skipped = max(0, (now_ns - t_ns) // self._period_ns)
        t_ns += skipped * self._period_ns
        self._clock.sleep_until_ns(t_ns)
        return self._begin_frame(t_ns, t_ns + self._period_ns, skipped, codec.decode_poses(b""))

    def _reconnect(self) -> None:
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_ns:
            return
        self._retry_ns = now_ns + RECONNECT_EVERY_NS
        frame, index, seq, timing_seq = self._frame, self._index, self._seq, self._timing_seq
        meter, rows, last_ns = self._meter, self._timing_rows, self._last_t_ns
        schemas = self._head_schema, self._timing_schema
        try:
            self._transport.open(CALL_TIMEOUT_S)
            self._learn()
        except DeviceError as problem:
            self._lost = f"lost the OpenVR runtime: {problem}"
            return
        self._frame, self._index, self._seq, self._timing_seq = frame, index, seq, timing_seq
        self._meter, self._timing_rows, self._last_t_ns = meter, rows, last_ns
        self._head_schema, self._timing_schema = schemas
        self._life.state = DeviceState.STREAMING

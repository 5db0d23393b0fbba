"""Drive a headset through an OpenVR runtime (SteamVR): pace, poses, submission, frame truth.

Codec: `visavis.devices.drivers.openvr.codec`. Wire: `visavis.devices.drivers.openvr.library`, a
`.wire` replay, or any `MessageTransport` with the same requests. The pose of a frame is the
runtime's prediction for the time of display; its `t_device_ns` is `predicted_display_ns`. Images
drawn from a later pose (`late_head`) are handed over with that pose. Call all of it, `wait_frame`
and `submit` included, from the thread that draws.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgpack
import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import HEAD, DeviceState, Fault
from visavis.devices.drivers.openvr import codec
from visavis.devices.drivers.openvr.display import (
    BaseStations,
    DisplayFacts,
    add_timing,
    read_display,
)
from visavis.devices.drivers.openvr.spec import OPENVR_HEADSET
from visavis.devices.drivers.runtimes.headset import CALL_TIMEOUT_S, HeadPose, RuntimeHeadset
from visavis.devices.drivers.streaming.message_device import legible
from visavis.devices.transports import Exchange, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError
from visavis.lab.frame import FrameInfo
from visavis.lab.geometry import Pose, rotate

BASE_STATIONS_EVERY_NS = 2 * NS_PER_S
REMAINING = struct.Struct("<d")

Array = npt.NDArray[Any]

FOCUS_LOST = "CompositorError_DoNotHaveFocus"
COMPOSITOR_REMEDIES = {
    "CompositorError_InvalidTexture": "the images were not textures of the current GL context: "
    "keep the context current, and submit RGBA8 textures that still exist",
    "CompositorError_TextureIsOnWrongDevice": "let the graphics card that drives the headset "
    "draw: choose it for Python in the graphics settings",
    "CompositorError_TextureUsesUnsupportedFormat": "submit RGBA8 textures without mip maps",
    "CompositorError_SharedTexturesNotSupported": "update the graphics driver",
    "CompositorError_AlreadySubmitted": "wait for the next frame before submitting again",
    "CompositorError_IsNotSceneApplication": "open the runtime as a scene application",
    "CompositorError_DoNotHaveFocus": "close the other VR program or SteamVR's dashboard",
}


@dataclass
class Findings:
    """Current problems; `submit_problem` is the error with which images were refused."""

    standby: bool = False
    taken_off: bool = False
    has_lost_focus: bool = False
    untracked: bool = False
    submit_problem: str = ""

    def faults(self, role: str, loss: str, moved_m: Mapping[str, float]) -> tuple[Fault, ...]:
        """Return the faults; `loss` says why the runtime is gone, `moved_m` is per base station."""
        faults = []
        if loss:
            faults.append(Fault(role, "blocking", loss, OPENVR_HEADSET.remedy))
        if self.standby:
            remedy = "ask the participant to put the headset on; wake it by moving it"
            faults.append(Fault(role, "blocking", "no head tracking: in standby", remedy))
        elif self.taken_off:
            remedy = "ask the participant to put the headset on"
            faults.append(Fault(role, "warning", "the headset is not worn", remedy))
        if self.untracked:
            remedy = "check that the base stations see the headset, and that it is connected"
            faults.append(Fault(role, "blocking", "the headset is not tracked", remedy))
        if self.has_lost_focus:
            remedy = COMPOSITOR_REMEDIES[FOCUS_LOST]
            faults.append(Fault(role, "blocking", "another VR program has the display", remedy))
        if self.submit_problem:
            remedy = COMPOSITOR_REMEDIES.get(self.submit_problem, OPENVR_HEADSET.remedy)
            text = f"images were refused: {self.submit_problem}"
            faults.append(Fault(role, "blocking", text, remedy))
        for serial, far_m in moved_m.items():
            text = f"base station {serial} moved by {far_m * 1e3:.0f} mm"
            remedy = "fix it to its place and run the room setup again"
            faults.append(Fault(role, "warning", text, remedy))
        return tuple(faults)


class OpenVrHeadset(RuntimeHeadset):
    """Follow the `Headset` contract over an OpenVR runtime."""

    runtime = "OpenVR runtime"

    def __init__(self, role: str, transport: MessageTransport, clock: Clock) -> None:
        self._photons_ns = 0
        self._midpoint = np.zeros(3)
        self._findings = Findings()
        self._bases = BaseStations()
        self._base_due_ns = 0
        self._last_count: int | None = None
        self._timing_raw = self._drawn_from = b""
        super().__init__(
            role,
            transport,
            clock,
            OPENVR_HEADSET,
            display_rate_hz=HEAD.nominal_rate_hz,
            render_size_px=(0, 0),
        )

    def wait_frame(self) -> FrameInfo:
        """Block until the runtime lets the next frame begin; take its poses and timing."""
        if self._life.state is DeviceState.FAULT:
            return self._wait_without_runtime()
        if self._life.state is not DeviceState.STREAMING:
            self._life.require("wait_frame", DeviceState.STREAMING)
        exchange = self._transport.request((b"wait_poses",), CALL_TIMEOUT_S)
        self._clock.sleep_until_ns(exchange.t_receive_ns)  # on a replay that time is still to come
        error = exchange.frames[0].decode("ascii", "replace")
        self._findings.has_lost_focus = error == FOCUS_LOST
        if error and not self._findings.has_lost_focus:
            self._lose(error)
            return self._wait_without_runtime()
        t_ns = max(exchange.t_receive_ns, self._last_t_ns + 1)
        has_vsync, since_ns, count = self._vsync(exchange, t_ns)
        remaining_ns = self._remaining_ns(exchange)
        if remaining_ns is None:
            predicted_ns = t_ns - since_ns + self._period_ns + self._photons_ns
            skipped_count = self._count_skipped(has_vsync, count, t_ns)
        else:
            predicted_ns = t_ns + remaining_ns + self._photons_ns
            skipped_count = self._skipped_to(predicted_ns)
            self._last_count = count if has_vsync else None
        self._timing_raw = exchange.frames[3] if len(exchange.frames) > 3 else b""
        self._close_frame()
        poses = codec.decode_poses(exchange.frames[1] if len(exchange.frames) > 1 else b"")
        if len(exchange.frames) > 5:  # older captures have none
            self._add_measured(self._head_of(codec.decode_poses(exchange.frames[5])), t_ns, t_ns)
        return self._begin_with(t_ns, max(predicted_ns, t_ns), skipped_count, poses)

    def late_head(self) -> Pose | None:
        """Return the head as the runtime now predicts it for the display of the last frame."""
        if self._frame is None:
            return None
        ahead_s = (self._frame.predicted_display_ns - self._clock.now_ns()) / NS_PER_S
        raw = self._late_answer((b"late", f"{max(ahead_s, 0.0):.9f}".encode()))
        poses = codec.decode_poses(raw)
        pose = codec.decode_pose(poses[0]) if len(poses) else None
        if pose is None:
            return None
        self._drawn_from = poses[0]["matrix"].tobytes()
        return self._between_eyes(pose)

    def submit(self, frame: FrameInfo, images: Sequence[object]) -> None:
        """Hand over one GL texture name per eye, left first; none shows nothing new.

        Raises DeviceError with the remedy when the runtime refuses an image, except when it only
        says that another program has the focus, which `check` reports.
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
            frames: tuple[bytes, ...] = (f"submit {eye}".encode(), str(name).encode())
            if self._drawn_from:
                frames = (*frames, self._drawn_from)
            error = (
                self._transport.request(frames, CALL_TIMEOUT_S).frames[0].decode("ascii", "replace")
            )
            if error == FOCUS_LOST:
                self._findings.has_lost_focus = True
            elif error:
                self._findings.submit_problem = error
                raise DeviceError(
                    f"the runtime refused the {('left', 'right')[eye]} image: {error}",
                    role=self.info.role,
                    remedy=COMPOSITOR_REMEDIES.get(error, OPENVR_HEADSET.remedy),
                )
        self._findings.submit_problem = ""
        self._submitted_ns = self._clock.now_ns()

    def check(self) -> tuple[Fault, ...]:
        """Report standby, a headset not worn, lost tracking, moved base stations, lost focus."""
        loss = self._loss if self.state is DeviceState.FAULT else ""
        self._findings.untracked = self._untracked
        faults = self._findings.faults(self.info.role, loss, self._bases.moved_m)
        return (*faults, *self._eyes_moved())

    # ---- private --------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        self._learn()

    def _connect_again(self) -> None:
        self._learn()

    def _learn(self) -> None:
        runtime = self._answer("runtime").decode("utf-8", "replace")
        self._learn_devices()
        facts = self._display_facts()
        self._set_rate(facts.rate_hz)
        self.render_size_px = facts.render_size_px
        self._photons_ns, self._midpoint = facts.photons_ns, facts.midpoint_m
        self._views = facts.views
        self.info = replace(self.info, driver_version=f"1 ({runtime})")

    def _display_facts(self) -> DisplayFacts:
        eyes = (self._answer("eye 0"), self._answer("eye 1"))
        role, remedy = self.info.role, OPENVR_HEADSET.remedy
        return read_display(self._answer("display"), eyes, role=role, remedy=remedy)

    def _learn_devices(self) -> None:
        with legible("the runtime's list of devices", OPENVR_HEADSET.remedy):
            rows = msgpack.unpackb(self._answer("devices"))
            self._bases.slots = {row[0]: row[3] for row in rows if row[1] == codec.BASE_STATION}
            for _, kind, _, serial, model, maker, _ in rows:
                if kind == codec.HMD:
                    self.info = replace(self.info, serial=serial, model=model, vendor=maker)

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._last_count = None

    def _vsync(self, exchange: Exchange, t_ns: int) -> tuple[bool, int, int]:
        raw = exchange.frames[2] if len(exchange.frames) > 2 else b""
        if len(raw) != codec.VSYNC.size:
            return False, 0, 0
        is_known, since_s, count = codec.VSYNC.unpack(raw)
        if not is_known or not 0 <= since_s < 1:
            return False, 0, 0
        return True, round(since_s * NS_PER_S), int(count)

    def _remaining_ns(self, exchange: Exchange) -> int | None:
        """Return the time to the sync at which the frame is shown; None where it is unknown.

        Runtimes hand out a frame some milliseconds before the sync at which it begins (running
        start). Counted from the last sync, its display would be predicted a whole frame too
        early. The runtime's own remaining time takes the running start into account.
        """
        raw = exchange.frames[4] if len(exchange.frames) > 4 else b""
        if len(raw) != REMAINING.size:
            return None
        (remaining_s,) = REMAINING.unpack(raw)
        remaining_ns = round(remaining_s * NS_PER_S) if math.isfinite(remaining_s) else 0
        return remaining_ns if 0 < remaining_ns <= 2 * self._period_ns else None

    def _skipped_to(self, predicted_ns: int) -> int:
        if self._frame is None:
            return 0
        step_ns = predicted_ns - self._frame.predicted_display_ns
        return max(0, round(step_ns / self._period_ns) - 1)

    def _count_skipped(self, has_vsync: bool, count: int, t_ns: int) -> int:
        before, self._last_count = self._last_count, count if has_vsync else None
        if self._frame is None:
            return 0
        if has_vsync and before is not None and 0 < count - before < 2**31:
            return count - before - 1
        return max(0, round((t_ns - self._last_t_ns) / self._period_ns) - 1)

    def _begin_with(
        self, t_ns: int, predicted_ns: int, skipped_count: int, poses: Array
    ) -> FrameInfo:
        head_pose = self._head_of(poses)
        self._drawn_from = b""
        if t_ns >= self._base_due_ns:
            self._base_due_ns = t_ns + BASE_STATIONS_EVERY_NS
            self._bases.look(poses)
        return self._begin_frame(t_ns, predicted_ns, skipped_count, head_pose)

    def _head_of(self, poses: Array) -> HeadPose:
        """Return the pose between the eyes from the headset's, which is the first of `poses`."""
        pose = codec.decode_pose(poses[0]) if len(poses) else None
        if pose is None:
            return None
        x, y, z = self._between_eyes(pose).position_m
        return (x, y, z), pose[1]

    def _between_eyes(self, headset_pose: tuple[codec.Triple, codec.Quadruple]) -> Pose:
        """Return the pose of the midpoint between the eyes from that of the headset."""
        turn = np.array(headset_pose[1])
        return Pose(np.array(headset_pose[0]) + rotate(turn, self._midpoint), turn)

    def _add_timing(self, row: np.void) -> None:
        add_timing(row, self._timing_raw)

    def _wait_without_runtime(self) -> FrameInfo:
        self._timing_raw, self._last_count = b"", None
        return self._wait_alone()

    def _take_events(self) -> None:
        for message in self._transport.receive(0.0):
            event = codec.decode_event(message.frames[-1])
            if event is not None:
                self._take_event(event)

    def _take_event(self, event: codec.VrEvent) -> None:
        if event.kind == "quit":
            self._lose("the runtime was closed")
        elif event.kind in ("standby", "awake"):
            self._findings.standby = event.kind == "standby"
        elif event.slot == 0 and event.kind in ("worn", "taken_off"):
            self._findings.taken_off = event.kind == "taken_off"
        elif event.slot == 0 and event.button == "worn":
            self._findings.taken_off = event.kind == "release"
        elif event.kind == "eyes_moved" and self.state is DeviceState.STREAMING:
            try:
                facts = self._display_facts()
            except DeviceError as problem:
                self._lose(str(problem))
            else:
                self._midpoint = facts.midpoint_m
                self._change_views(facts.views)
        elif event.kind in ("activated", "deactivated") and self.state is DeviceState.STREAMING:
            try:
                self._learn_devices()
            except DeviceError as problem:
                self._lose(str(problem))

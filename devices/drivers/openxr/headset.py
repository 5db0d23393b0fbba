"""Drive a headset through an OpenXR runtime: pace, poses and, once asked for, images.

`show_images` before `open` makes it a session with graphics, in the OpenGL context that is then
current; otherwise it is headless and refuses images. The pose of a frame is the runtime's
prediction for its time of display, with the view space's origin taken as the midpoint between the
eyes; `late_head` asks for it again. Images are handed over with the pose and the views they were
drawn from. OpenXR has no frame timing: skipped frames are found from the runtime's display times.
Call all of it from the thread that draws.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import msgpack
import numpy as np

from visavis.devices.contracts import DeviceState, Fault
from visavis.devices.drivers.openxr.graphics import packed_images
from visavis.devices.drivers.openxr.packing import FRAME, LATE, pose_of, turn_alone
from visavis.devices.drivers.openxr.spec import OPENXR_HEADSET
from visavis.devices.drivers.runtimes.headset import CALL_TIMEOUT_S, HeadPose, RuntimeHeadset
from visavis.devices.drivers.streaming.message_device import legible
from visavis.devices.transports import MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceError, ProtocolViolation
from visavis.lab.frame import EyeView, FrameInfo
from visavis.lab.geometry import Pose, Vector, quat_multiply, rotate

MAX_AHEAD_NS = 60 * NS_PER_S
"""A display time further ahead is not believed."""
Corners = tuple[tuple[float, float], ...]
USUAL_EYE_PX = (1440, 1600)
"""Size until the runtime was asked; only a session with graphics asks."""


class OpenXrHeadset(RuntimeHeadset):
    """Follow the `Headset` contract over an OpenXR session."""

    runtime = "OpenXR session"

    def __init__(
        self, role: str, transport: MessageTransport, clock: Clock, *, display_rate_hz: float = 90
    ) -> None:
        self._image_refusal = ""
        self._shows_images = self._has_lost_focus = self._tells_hidden = False
        self._drawn_from: tuple[Vector, Vector] = (np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
        self._last_display: int | None = None
        super().__init__(
            role,
            transport,
            clock,
            OPENXR_HEADSET,
            display_rate_hz=float(display_rate_hz),
            render_size_px=USUAL_EYE_PX,
        )

    def show_images(self) -> None:
        """Begin the next session with graphics, in the context that is current at `open`."""
        self._life.require("show_images", DeviceState.CLOSED)
        self._transport.post((b"images",))
        self._shows_images = True
        self.info = replace(self.info, capabilities=self.info.capabilities | {"display"})

    def wait_frame(self) -> FrameInfo:
        """Block until the runtime lets the next frame begin, and locate the head in it."""
        if self._life.state is DeviceState.STREAMING:
            exchange = self._transport.request((b"frame",), CALL_TIMEOUT_S)
            self._clock.sleep_until_ns(
                exchange.t_receive_ns
            )  # on a replay that time is still to come
            error, *rest = exchange.frames
            if not error and rest and len(rest[0]) == FRAME.size:
                self._has_lost_focus = rest[1:2] == [b"0"]
                measured = rest[2] if len(rest) > 2 else b""  # missing in older captures
                if len(rest) > 3:
                    self._move_eyes(rest[3])
                return self._begin(FRAME.unpack(rest[0]), measured, exchange.t_receive_ns)
            self._lose(error.decode("ascii", "replace") or "an unreadable answer")
        self._life.require("wait_frame", DeviceState.STREAMING, DeviceState.FAULT)
        return self._wait_alone()

    def late_head(self) -> Pose | None:
        """Return the head as the runtime now predicts it for the display of the last frame."""
        if not self._shows_images:
            return None
        answer = self._late_answer((b"late",))
        if len(answer) != LATE.size:
            return None
        flags, *numbers = LATE.unpack(answer)
        pose = pose_of(int(flags), numbers, fully_tracked=True)
        self._draw_from(pose)
        return None if pose is None else Pose(*self._drawn_from)

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
        request = (b"show", self._pack_images(images)) if images else (b"show",)
        error = (
            self._transport.request(request, CALL_TIMEOUT_S).frames[0].decode("ascii", "replace")
        )
        if error and images:
            self._image_refusal = error
            raise DeviceError(
                f"the runtime refused the images: {error}",
                role=self.info.role,
                remedy="hand over two RGBA8 textures of the context that was current when the "
                f"session was opened; {OPENXR_HEADSET.remedy}",
            )
        if images:
            self._image_refusal = ""
            self._submitted_ns = self._clock.now_ns()

    def check(self) -> tuple[Fault, ...]:
        """Report a lost session, lost tracking, a lost focus and refused images."""
        role = self.info.role
        if self.state is DeviceState.FAULT:
            return (Fault(role, "blocking", self._loss, OPENXR_HEADSET.remedy),)
        if self._image_refusal:
            text = f"images were refused: {self._image_refusal}"
            return (Fault(role, "blocking", text, OPENXR_HEADSET.remedy),)
        faults = list(self._eyes_moved())
        if self._untracked:
            remedy = "put the headset on and check its tracking"
            if self._turn_alone is None:
                faults.append(Fault(role, "blocking", "the headset is not tracked", remedy))
            else:
                text = "only the headset's orientation is tracked, its place is inferred"
                faults.append(Fault(role, "warning", text, remedy))
        if self._has_lost_focus:
            remedy = "close the runtime's menu and other VR programs; put the headset on"
            text = "the session has not got the focus: participants see something else"
            faults.append(Fault(role, "blocking", text, remedy))
        return tuple(faults)

    # ---- private --------------------------------------------------------------------------

    def _connect(self, deadline_ns: int) -> None:
        """Begin the session, read the views and one frame's period."""
        name, *facts = msgpack.unpackb(self._answer("runtime"))
        self._tells_hidden = facts[2:3] == [True]  # missing in older captures
        self._learn_views()
        if self._shows_images:
            width, height = msgpack.unpackb(self._answer("size"))
            self.render_size_px = (int(width), int(height))
        period_ns = FRAME.unpack(self._answer("frame"))[3]
        if period_ns > 0:
            self._set_rate(NS_PER_S / period_ns)
        self.info = replace(self.info, model=f"OpenXR headset ({name})")

    def _connect_again(self) -> None:
        self._learn_views()
        self._last_display = None

    def _reset(self, now_ns: int) -> None:
        super()._reset(now_ns)
        self._last_display = None

    def _move_eyes(self, message: bytes) -> None:
        """Take views that the runtime changed; what lenses hide stays as it was told."""
        if self._views is not None:
            left, right = self._read_views(message, (self._views[0].hidden, self._views[1].hidden))
            self._change_views((left, right))

    def _learn_views(self) -> None:
        self._views = self._read_views(self._answer("views"), self._hidden_areas())

    def _read_views(
        self, packed: bytes, hidden: tuple[Corners, Corners]
    ) -> tuple[EyeView, EyeView]:
        rows = msgpack.unpackb(packed)
        if len(rows) != 2:
            raise ProtocolViolation(
                f"the runtime has {len(rows)} views, not 2", remedy=OPENXR_HEADSET.remedy
            )
        left, right = (
            EyeView(
                (row[0], row[1], row[2]),
                (row[6], row[3], row[4], row[5]),
                *(math.tan(angle) for angle in row[7:11]),
                hidden=corners,
            )
            for row, corners in zip(rows, hidden, strict=True)
        )
        return left, right

    def _hidden_areas(self) -> tuple[Corners, Corners]:
        """Return the areas that the lenses hide; empty where the runtime does not say."""
        if not self._tells_hidden:
            return (), ()
        with legible("what the lenses hide", OPENXR_HEADSET.remedy):
            left, right = (
                tuple((float(x), float(y)) for x, y in corners)
                for corners in msgpack.unpackb(self._answer("hidden"))
            )
        for corners in (left, right):
            if len(corners) % 3 or not all(math.isfinite(x + y) for x, y in corners):
                raise ProtocolViolation(
                    "the runtime's account of what the lenses hide is not of triangles",
                    remedy=OPENXR_HEADSET.remedy,
                )
        return left, right

    def _begin(self, numbers: tuple[float, ...], measured: bytes, t_receive_ns: int) -> FrameInfo:
        _host_ns, now, display, period, flags = (int(n) for n in numbers[:5])
        t_ns = max(t_receive_ns, self._last_t_ns + 1)
        # Both stamps are of one instant, so their difference also holds on a replay, moved in time.
        ahead_ns = max(0, display - now)
        predicted_ns = t_ns + (ahead_ns if ahead_ns < MAX_AHEAD_NS else self._period_ns)
        skipped_count = 0
        before = self._last_display
        if before is not None and period > 0 and abs(display - before) < MAX_AHEAD_NS:
            skipped_count = max(0, round((display - before) / period) - 1)
        self._last_display = display
        self._turn_alone = turn_alone(flags, numbers[5:])
        pose = pose_of(flags, numbers[5:], fully_tracked=True)
        self._draw_from(pose)
        self._close_frame()
        if len(measured) == LATE.size:
            now_flags, *now_numbers = LATE.unpack(measured)
            now_pose = pose_of(int(now_flags), now_numbers, fully_tracked=True)
            self._add_measured(now_pose, t_ns, t_ns)
        return self._begin_frame(t_ns, predicted_ns, skipped_count, pose)

    def _draw_from(self, pose: HeadPose) -> None:
        """Take this pose as the one that images are drawn from; None changes nothing."""
        if pose is not None:
            drawn_from = np.array((*pose[0], *pose[1]), np.float32).astype(np.float64)
            self._drawn_from = (drawn_from[:3], drawn_from[3:])

    def _pack_images(self, images: Sequence[object]) -> bytes:
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

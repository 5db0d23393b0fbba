"""An OpenXR runtime without a headset: the genuine loader finds it, and it tracks a body.

A small C library (`native/openxr_runtime`) is compiled when it is first needed and hands out
the functions of this module, made with pyopenxr's own prototypes. It offers headless sessions,
sessions with OpenGL (`images` reads back the images shown), controllers (`hands`), hand joints
(`joints`), eye gaze, each eye if configured (`eyes`), and time conversion. It refuses what the
specification calls an error: calls out of order or in another state of the session, times and
handles that are none, names and paths that are not well formed, actions asked for as another type.
A headless session has no frames, as with Monado. A session with graphics gets the focus only after
its first frames. Gaze is sampled at its own rate, so locating it
twice within a period gives the same sample. The head at a time to come is foreseen from how it
moves (`visavis.devices.sim.foresight`). Not modelled: boundaries, the runtime's smoothing of gaze.
"""

# ruff: noqa: N802 - the functions bear the names of OpenXR

import ctypes
import json
import os
import tempfile
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from visavis.devices.contracts import Body
from visavis.devices.drivers.openxr.graphics import EGL, OPENGL, VISIBILITY_MASK
from visavis.devices.drivers.openxr.library import EYE_GAZE, HEADLESS, OpenXrLibrary
from visavis.devices.drivers.openxr.runtime_time import FROM_COUNTER, TIMESPEC
from visavis.devices.faults import FaultSchedule
from visavis.devices.libraries import OPENXR
from visavis.devices.sim.foresight import Foresight
from visavis.devices.sim.native_build import build_library
from visavis.devices.sim.openxr.eyes import (
    SUPPORTS_HTC,
    SimulatedEyes,
    turned_to,
)
from visavis.devices.sim.openxr.hands import SimulatedHands
from visavis.devices.sim.openxr.images import CALL_ORDER_INVALID, SimulatedImages
from visavis.devices.sim.openxr.joints import EXTENSION as HAND_TRACKING
from visavis.devices.sim.openxr.joints import SimulatedJoints
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock

EPOCH_NS = 7_000_000_000_000
"""Time of the runtime's clock when the session's clock is at zero."""

MILLI_HZ, TICK_NS = 1000, 100
RUNTIME_NAME = b"Visavis simulated OpenXR"
SUCCESS, EVENT_UNAVAILABLE, FRAME_DISCARDED = 0, 4, 9
RUNTIME_FAILURE, INSTANCE_LOST = -2, -13
WITHOUT_INSTANCE = (
    "xrCreateInstance",
    "xrDestroyInstance",
    "xrEnumerateInstanceExtensionProperties",
)
API_VERSION_UNSUPPORTED, FORM_FACTOR_UNAVAILABLE = -4, -35
SESSION_RUNNING, SESSION_NOT_RUNNING, TIME_INVALID = -14, -16, -30
SESSION_NOT_READY, SESSION_NOT_STOPPING, HANDLE_INVALID = -28, -29, -12
ACTIONSETS_NOT_ATTACHED, SIZE_INSUFFICIENT = -46, -11
IDLE, READY, SYNCHRONIZED, VISIBLE, FOCUSED, STOPPING, LOSS_PENDING, EXITING = range(1, 9)
ALL_VALID_AND_TRACKED = 0b1111
STAGE, VIEW, GAZE, FIRST_HAND = 3, 1, 99, 100
FIRST_HANDLE = 0x1000
HIDDEN_CORNER_01 = 0.2
"""Share of the picture's sides that the lens cuts off at each corner."""
VIEW_ANGLES_RAD = (-0.87, 0.82, -0.85, 0.86)
RENDER_SIZE_PX = (1512, 1680)
IPD_M = 0.063


class SimulatedXrRuntime:
    """Stand in for an OpenXR runtime in this process from `with` to its end.

    Faults: late_start (no headset), version (too old), eyes_lost, silence
    (nothing is located), standby (the session loses the focus and runs on), disconnect (the
    session is lost). Light leaves `look_ahead_ms` after a frame begins, or two frames (None). Only
    one such runtime can exist in a process at a time.
    """

    def __init__(
        self,
        body: Body,
        clock: Clock,
        *,
        gaze_rate_hz: float = 120.0,
        display_rate_hz: float = 90.0,
        faults: FaultSchedule | None = None,
        supports_gaze: bool = True,
        tells_sample_time: bool = True,
        time_extension: str = TIMESPEC,
        hides_corners: bool = True,
        look_ahead_ms: float | None = None,
        offers_headless: bool = True,
    ) -> None:
        self.failure: Exception | None = None
        self.ipd_m = IPD_M
        """How far the eyes are apart; a knob changes it."""
        self.ready_after_ns = 0
        """How long after a session was made it may begin."""
        self.calls: list[str] = []
        self._body = body
        self._clock = clock
        self._foresight = Foresight(body)
        self._ahead_ns = None if look_ahead_ms is None else round(look_ahead_ms * NS_PER_MS)
        self._gaze_period_ns = round(NS_PER_S / gaze_rate_hz)
        self._rate_milli_hz = round(display_rate_hz * MILLI_HZ)
        self._faults = faults if faults is not None else FaultSchedule()
        self._supports_gaze = supports_gaze
        self._hides_corners = hides_corners
        self._offers_headless = offers_headless
        self._tells_sample_time = tells_sample_time
        self._time_extension = time_extension
        self._origin_ns = clock.now_ns()
        self._states: deque[int] = deque()
        self._spaces: dict[int, int] = {}
        self._handles = FIRST_HANDLE
        self._running = self._is_lost = self._is_headless = False
        self._has_waited = self._is_in_frame = self._away = False
        self._display_time = self._frames_ended = 0
        self.images = SimulatedImages(self._new_handle)
        self.hands = SimulatedHands(body, clock.now_ns, self._has_focus)
        self.hands.allocate_with(self._new_handle)
        self.joints = SimulatedJoints(
            self.hands, lambda: self._active("silence") or not self._has_focus(), EPOCH_NS
        )
        self.joints.allocate_with(self._new_handle)
        self.eyes = SimulatedEyes(
            body,
            lambda at_ns: at_ns // self._gaze_period_ns * self._gaze_period_ns,
            self._eyes_are_lost,
            EPOCH_NS,
        )
        self.eyes.allocate_with(self._new_handle)
        self._last_frame = -1
        self._made_ns = 0
        self._is_dead = self._is_instance_lost = False
        self._state = 0
        """The session's state by the last event that was taken."""
        self._keep: list[Any] = []
        self._before: str | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._native: Any = None
        self._xr: Any = None

    def __enter__(self) -> "SimulatedXrRuntime":
        self._xr = OPENXR.imported()
        library = build_library("openxr_runtime/runtime.c", {}, "libvisavis_openxr.so")
        self._folder = tempfile.TemporaryDirectory(prefix="visavis-openxr-")
        manifest = Path(self._folder.name) / "runtime.json"
        runtime = {"name": "Visavis", "library_path": str(library)}
        manifest.write_text(json.dumps({"file_format_version": "1.0.0", "runtime": runtime}))
        self._before = os.environ.get("XR_RUNTIME_JSON")
        os.environ["XR_RUNTIME_JSON"] = str(manifest)
        self._native = ctypes.CDLL(str(library))
        for part in (self, self.images, self.hands, self.joints, self.eyes):
            for name in dir(type(part)):
                if name.startswith("_xr_"):
                    self._offer("xr" + name.removeprefix("_xr_"), getattr(part, name))
        return self

    def __exit__(self, kind: object, problem: object, trace: object) -> None:
        if self._before is None:
            os.environ.pop("XR_RUNTIME_JSON", None)
        else:
            os.environ["XR_RUNTIME_JSON"] = self._before
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        if problem is None and self.failure is not None:
            raise self.failure

    def library(self) -> OpenXrLibrary:
        """Return the real library, which will find this runtime."""
        return OpenXrLibrary(self._clock, counter=lambda: self._clock.now_ns() // TICK_NS)

    def crash(self) -> None:
        """Die, as a runtime's service does: every call but the end of the instance is refused."""
        self._is_dead = self._is_instance_lost = True

    def restart(self) -> None:
        """Let a new instance be made; the one from before the crash stays lost."""
        self._is_dead = False

    def end(self) -> None:
        """End the session from the runtime's side, as when its program is closed."""
        self._states.extend((VISIBLE, SYNCHRONIZED, STOPPING, IDLE, EXITING))

    # ---- instance and session ---------------------------------------------------------------

    def _xr_EnumerateInstanceExtensionProperties(
        self, layer: Any, capacity: int, count: Any, properties: Any
    ) -> int:
        names = [HEADLESS] if self._offers_headless else []
        names += [self._time_extension, EYE_GAZE, OPENGL, EGL]
        names += [self.eyes.extension] if self.eyes.extension else []
        names += [VISIBILITY_MASK] if self._hides_corners else []
        names += self.hands.extensions
        names += [HAND_TRACKING] if self.joints.is_supported else []
        count[0] = len(names)
        if capacity and properties:
            for i, name in enumerate(names):
                properties[i].extension_name = name.encode()
                properties[i].extension_version = 1
        return SUCCESS

    def _xr_CreateInstance(self, info: Any, instance: Any) -> int:
        if self._is_dead:
            return RUNTIME_FAILURE
        self._is_instance_lost = False
        if self._active("version"):
            return API_VERSION_UNSUPPORTED
        names = info.contents.enabled_extension_names
        texts = [n.decode() if isinstance(n, bytes) else str(n) for n in names]
        self._is_headless = HEADLESS in texts
        self.joints.is_enabled = HAND_TRACKING in texts
        return self._new(instance)

    def _xr_DestroyInstance(self, instance: Any) -> int:
        self._states.clear()
        self._state = 0
        self._spaces.clear()
        self._running = self._is_lost = self._has_waited = self._is_in_frame = False
        self._frames_ended = 0
        self.images.forget()
        self.hands.forget()
        return SUCCESS

    def _xr_GetInstanceProperties(self, instance: Any, properties: Any) -> int:
        properties.contents.runtime_name = RUNTIME_NAME
        return SUCCESS

    def _xr_GetSystem(self, instance: Any, info: Any, system: Any) -> int:
        if self._active("late_start"):
            return FORM_FACTOR_UNAVAILABLE
        ctypes.cast(system, ctypes.POINTER(ctypes.c_uint64))[0] = 1
        return SUCCESS

    def _xr_GetSystemProperties(self, instance: Any, system: Any, properties: Any) -> int:
        gaze = self._next_struct(properties, self._xr.SystemEyeGazeInteractionPropertiesEXT)
        if gaze is not None:
            gaze.supports_eye_gaze_interaction = self._supports_gaze
        each = self._next_struct(properties, self._xr.SystemEyeTrackingPropertiesFB)
        if each is not None:
            each.supports_eye_tracking = self.eyes.supported
        hands = self._next_struct(properties, self._xr.SystemHandTrackingPropertiesEXT)
        if hands is not None:
            hands.supports_hand_tracking = self.joints.is_supported
        address = self._link_of(properties, SUPPORTS_HTC)
        if address:
            self.eyes.answer_properties(address)
        return SUCCESS

    def _xr_CreateSession(self, instance: Any, info: Any, session: Any) -> int:
        if not self._is_headless and (problem := self.images.session_result(self._next_of(info))):
            return problem
        self._states.extend((IDLE, READY))
        self._made_ns = self._clock.now_ns()
        return self._new(session)

    def _xr_DestroySession(self, session: Any) -> int:
        return SUCCESS

    def _xr_BeginSession(self, session: Any, info: Any) -> int:
        if self._running:
            return SESSION_RUNNING
        if self._state != READY:
            return SESSION_NOT_READY
        self._running = True
        if self._is_headless:
            self._states.extend((SYNCHRONIZED, VISIBLE, FOCUSED))
        return SUCCESS

    def _xr_EndSession(self, session: Any) -> int:
        if not self._running:
            return SESSION_NOT_RUNNING
        if self._state != STOPPING:
            return SESSION_NOT_STOPPING
        self._running = False
        return SUCCESS

    def _xr_PollEvent(self, instance: Any, event: Any) -> int:
        if self._active("disconnect") and not self._is_lost:
            self._is_lost = True
            self._states.append(LOSS_PENDING)
        away = self._running and self._active("standby")
        if away != self._away and not self._states:
            self._away = away
            self._states.append(VISIBLE if away else FOCUSED)
        is_early = self._clock.now_ns() < self._made_ns + self.ready_after_ns
        if not self._states or (self._states[0] == READY and is_early):
            return EVENT_UNAVAILABLE
        event_type = self._xr.EventDataSessionStateChanged
        target = ctypes.cast(event, ctypes.POINTER(event_type)).contents
        kind = int(self._xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED.value)
        ctypes.cast(event, ctypes.POINTER(ctypes.c_int32))[0] = kind
        self._state = self._states.popleft()
        target.state = self._xr.SessionState(self._state)
        return SUCCESS

    # ---- spaces, frames, times ------------------------------------------------------------------

    def _xr_CreateActionSpace(self, session: Any, info: Any, space: Any) -> int:
        if not self.hands.is_attached:
            return ACTIONSETS_NOT_ATTACHED
        hand = self.hands.hand_of(info.contents)
        return self._new_space(space, GAZE if hand is None else FIRST_HAND + hand)

    def _xr_CreateReferenceSpace(self, session: Any, info: Any, space: Any) -> int:
        kind = info.contents.reference_space_type
        return self._new_space(space, int(getattr(kind, "value", kind)))

    def _xr_DestroySpace(self, space: Any) -> int:
        self._spaces.pop(self._handle(space), None)
        return SUCCESS

    def _xr_LocateSpace(self, space: Any, base: Any, at: Any, location: Any) -> int:
        if int(getattr(at, "value", at)) <= 0:
            return TIME_INVALID
        if self._handle(space) not in self._spaces or self._handle(base) not in self._spaces:
            return HANDLE_INVALID
        at_ns = int(getattr(at, "value", at)) - EPOCH_NS
        kind = self._spaces[self._handle(space)]
        if kind == GAZE:
            pose = self._gaze_at(at_ns, location)
        elif kind >= FIRST_HAND:
            is_lost = self._active("silence") or not self._has_focus()
            pose = None if is_lost else self.hands.pose(kind - FIRST_HAND, max(0, at_ns))
        else:
            is_lost = self._active("silence") or self._active("standby")
            position, turn = self._foresight.at(self._clock.now_ns(), max(0, at_ns))
            pose = None if is_lost else (position.tolist(), turn.tolist())
        self._write(location, pose)
        return SUCCESS

    def _xr_EnumerateViewConfigurationViews(
        self, instance: Any, system: Any, kind: Any, capacity: int, count: Any, views: Any
    ) -> int:
        count[0] = 2
        if capacity >= 2 and views:
            for eye in range(2):
                views[eye].recommended_image_rect_width = RENDER_SIZE_PX[0]
                views[eye].recommended_image_rect_height = RENDER_SIZE_PX[1]
        return SUCCESS

    def _xr_LocateViews(
        self, session: Any, info: Any, state: Any, capacity: int, count: Any, views: Any
    ) -> int:
        display_time = info.contents.display_time
        if int(getattr(display_time, "value", display_time)) <= 0:
            return TIME_INVALID
        count[0] = 2
        if capacity >= 2 and views:
            for eye, side in enumerate((-0.5, 0.5)):
                view = views[eye]
                view.pose.position.x = side * self.ipd_m
                view.pose.orientation.w = 1.0
                angles = VIEW_ANGLES_RAD
                view.fov.angle_left, view.fov.angle_right = angles[:2]
                view.fov.angle_down, view.fov.angle_up = angles[2:]
        return SUCCESS

    def _xr_GetVisibilityMaskKHR(
        self, session: Any, kind: Any, eye: int, mask_type: Any, mask: Any
    ) -> int:
        """Tell the triangles that cut off the four corners; the left eye's wind the other way."""
        left, right, down, up = np.tan(VIEW_ANGLES_RAD)
        share, mask_data = HIDDEN_CORNER_01, mask.contents
        wide, high = share * (right - left), share * (up - down)
        corners = [
            point
            for x, y, dx, dy in (
                (left, down, wide, high),
                (right, down, -wide, high),
                (right, up, -wide, -high),
                (left, up, wide, -high),
            )
            for point in ((x, y), (x + dx, y), (x, y + dy))
        ]
        order = range(len(corners)) if eye else range(len(corners) - 1, -1, -1)
        mask_data.vertex_count_output = mask_data.index_count_output = len(corners)
        if not mask_data.vertex_capacity_input and not mask_data.index_capacity_input:
            return SUCCESS
        if min(mask_data.vertex_capacity_input, mask_data.index_capacity_input) < len(corners):
            return SIZE_INSUFFICIENT
        for i, ((x, y), index) in enumerate(zip(corners, order, strict=True)):
            mask_data.vertices[i].x, mask_data.vertices[i].y = x, y
            mask_data.indices[i] = index
        return SUCCESS

    def _xr_WaitFrame(self, session: Any, info: Any, state: Any) -> int:
        if not self._running:
            return SESSION_NOT_RUNNING
        if self._is_headless:
            return SUCCESS  # as Monado: the times of the state are left as they were
        if self._has_waited:
            raise AssertionError("xrWaitFrame was called twice, which blocks for ever")
        scale, rate = NS_PER_S * MILLI_HZ, self._rate_milli_hz
        frame = max(-(-self._clock.now_ns() * rate // scale), self._last_frame + 1)
        self._last_frame = frame
        due, period = frame * scale // rate, round(scale / rate)
        self._clock.sleep_until_ns(due)
        numbers = ctypes.cast(ctypes.byref(state.contents, 16), ctypes.POINTER(ctypes.c_int64))
        ahead_ns = 2 * period if self._ahead_ns is None else self._ahead_ns
        numbers[0], numbers[1] = due + ahead_ns + EPOCH_NS, period
        self._has_waited, self._display_time = True, int(numbers[0])
        return SUCCESS

    def _xr_BeginFrame(self, session: Any, info: Any) -> int:
        if not self._running:
            return SESSION_NOT_RUNNING
        if self._is_headless or not self._has_waited:
            return CALL_ORDER_INVALID  # a session without graphics has no frames
        is_discarded = self._is_in_frame
        self._has_waited, self._is_in_frame = False, True
        return FRAME_DISCARDED if is_discarded else SUCCESS

    def _xr_EndFrame(self, session: Any, info: Any) -> int:
        if not self._running:
            return SESSION_NOT_RUNNING
        if not self._is_in_frame:
            return CALL_ORDER_INVALID
        if int(info.contents.display_time) != self._display_time:
            return TIME_INVALID
        self._is_in_frame = False
        self._frames_ended += 1
        if not self._is_headless and self._frames_ended <= 2:
            self._states.extend(((SYNCHRONIZED,), (VISIBLE, FOCUSED))[self._frames_ended - 1])
        return self.images.layers_result(info.contents)

    def _xr_ConvertTimespecTimeToTimeKHR(self, instance: Any, stamp: Any, time: Any) -> int:
        time_ns = stamp.contents.tv_sec * NS_PER_S + stamp.contents.tv_nsec + EPOCH_NS
        ctypes.cast(time, ctypes.POINTER(ctypes.c_int64))[0] = time_ns
        return SUCCESS

    def _xr_ConvertWin32PerformanceCounterToTimeKHR(
        self, instance: Any, ticks: Any, time: Any
    ) -> int:
        time[0] = ticks[0] * TICK_NS + EPOCH_NS
        return SUCCESS

    # ---- inside -----------------------------------------------------------------------------

    def _gaze_at(self, at_ns: int, location: Any) -> tuple[list[float], list[float]] | None:
        sampled_ns = at_ns // self._gaze_period_ns * self._gaze_period_ns
        sample_time = self._next_struct(location, self._xr.EyeGazeSampleTimeEXT)
        eyes = self._body.eyes(np.array((max(0, sampled_ns),), np.int64))[0]
        is_lost = self._eyes_are_lost()
        if sample_time is not None and self._tells_sample_time:
            at = self._xr.EyeGazeSampleTimeEXT.time.offset
            target = ctypes.cast(ctypes.byref(sample_time, at), ctypes.POINTER(ctypes.c_int64))
            target[0] = sampled_ns + EPOCH_NS
        if is_lost or eyes["openness_01"] < 0.5:
            return None
        mean = eyes["left_direction_head"] + eyes["right_direction_head"]
        return [0.0, 0.0, 0.0], turned_to(mean / np.linalg.norm(mean))

    def _eyes_are_lost(self) -> bool:
        return any(map(self._active, ("silence", "standby", "eyes_lost")))

    def _write(self, location: Any, place_and_turn: tuple[list[float], list[float]] | None) -> None:
        flags = ctypes.cast(ctypes.byref(location.contents, 16), ctypes.POINTER(ctypes.c_uint64))
        flags[0] = 0 if place_and_turn is None else ALL_VALID_AND_TRACKED
        position, (w, x, y, z) = place_and_turn or ([0.0] * 3, [0.0] * 4)
        pose = location.contents.pose
        pose.position.x, pose.position.y, pose.position.z = position
        pose.orientation.x, pose.orientation.y = x, y
        pose.orientation.z, pose.orientation.w = z, w

    def _next_struct(self, head: Any, kind: Any) -> Any:
        """Return the structure of this kind in a `next` chain, or None."""
        link = self._link_of(head, int(kind().type.value))
        return ctypes.cast(link, ctypes.POINTER(kind)).contents if link else None

    def _link_of(self, head: Any, type_number: int) -> int:
        """Return where the structure of this type lies in a `next` chain, or 0."""
        link = self._next_of(head)
        while link and ctypes.cast(link, ctypes.POINTER(ctypes.c_int32))[0] != type_number:
            link = ctypes.cast(link + 8, ctypes.POINTER(ctypes.c_void_p))[0]
        return int(link or 0)

    def _next_of(self, head: Any) -> Any:
        return ctypes.cast(ctypes.byref(head.contents, 8), ctypes.POINTER(ctypes.c_void_p))[0]

    def _active(self, kind: str) -> bool:
        since_ns = self._clock.now_ns() - self._origin_ns
        return self._faults.active(kind, since_ns) is not None

    def _has_focus(self) -> bool:
        return self._running and not self._active("standby")

    def _new_handle(self, target: Any) -> int:
        self._handles += 16
        ctypes.cast(target, ctypes.POINTER(ctypes.c_void_p))[0] = self._handles
        return self._handles

    def _new(self, target: Any) -> int:
        self._new_handle(target)
        return SUCCESS

    def _new_space(self, target: Any, kind: int) -> int:
        self._new(target)
        self._spaces[self._handles] = kind
        return SUCCESS

    def _handle(self, handle: Any) -> int:
        return int(ctypes.cast(handle, ctypes.c_void_p).value or 0)

    def _offer(self, name: str, function: Callable[..., int]) -> None:
        prototypes = {
            "xrConvertWin32PerformanceCounterToTimeKHR": FROM_COUNTER,
            **self.eyes.prototypes,
        }
        prototype = prototypes.get(name) or getattr(self._xr, f"PFN_{name}")

        def call(*args: Any) -> int:
            self.calls.append(name)
            if self._is_instance_lost and name not in WITHOUT_INSTANCE:
                return INSTANCE_LOST
            try:
                return function(*args)
            except Exception as problem:  # exceptions must not reach C code
                self.failure = self.failure or problem
                return RUNTIME_FAILURE

        callback = prototype(call)
        self._keep.append(callback)
        pointer = ctypes.cast(callback, ctypes.c_void_p)
        self._native.visavis_xr_set_function(name.encode(), pointer)

"""An OpenVR runtime without SteamVR: the genuine `openvr` package loads it; it tracks a body.

A small C library (`native/vrclient`) is compiled when it is first needed; its function tables
are built from the package's own definitions and filled with functions of this module. Not modelled:
lens distortion, IVRInput and every interface but IVRSystem and IVRCompositor, tracking noise,
reprojection. Poses of a frame are foreseen for its light from how the head moves
(`visavis.devices.sim.foresight`). `on_submit` gets
the GL names of images; with `on_image` every texture is read back from the card as it is handed
over, and one that is not there is refused.
"""

import ctypes
import json
import os
import platform
import struct
import tempfile
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import Body
from visavis.devices.drivers.openvr.library import OpenVrLibrary
from visavis.devices.faults import FaultSchedule
from visavis.devices.libraries import OPENVR
from visavis.devices.sim.image_reader import ImageReader
from visavis.devices.sim.native_build import build_library
from visavis.devices.sim.openvr.tables import FunctionTables, table_header
from visavis.devices.sim.openvr.world import CONTROLLER, POSE_BYTES, SimulatedVrWorld
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError
from visavis.lab.geometry import Vector

MILLI_HZ = 1000
MAKER = "Visavis"
IPD_M = 0.063
PHOTONS_S = 0.011
RENDER_SIZE_PX = (960, 1080)
RAW_TANGENTS = ((-1.39, 1.25, -1.47, 1.46), (-1.25, 1.39, -1.47, 1.46))
"""Left, right, top, bottom of each eye, near those of a first-generation room-scale headset."""
HIDDEN_01 = (
    ((0.0, 0.0), (0.2, 0.0), (0.0, 0.2)),
    ((0.0, 1.0), (0.2, 1.0), (0.0, 0.8)),
    ((1.0, 1.0), (0.8, 1.0), (1.0, 0.8)),
    ((1.0, 0.0), (0.7, 0.0), (1.0, 0.4)),
)
"""The part of the left eye's view hidden by the lens, as shares from the left and from below: its
corners, most beside the nose. The right eye's is the mirror image.
"""

BUTTON_NUMBERS = {
    "system": 0,
    "menu": 1,
    "grip": 2,
    "a": 7,
    "worn": 31,
    "trackpad": 32,
    "trigger": 33,
}
EVENT_NUMBERS = {
    "activated": 100,
    "deactivated": 101,
    "eyes_moved": 105,
    "standby": 106,
    "awake": 107,
    "role_changed": 108,
    "press": 200,
    "release": 201,
    "quit": 700,
}
RIGHT_CONTROLLER_SLOT = 2


def packed_event(size: int, kind: str, slot: int, age_s: float, button: str) -> bytes:
    """Return an event as the runtime's own structure of `size` bytes holds it."""
    raw = bytearray(size)
    struct.pack_into("<IIf", raw, 0, EVENT_NUMBERS[kind], slot, age_s)
    if button:
        at = 12 if size % 8 == 4 else 16
        struct.pack_into("<I", raw, at, BUTTON_NUMBERS[button])
    return bytes(raw)


def button_of(control: str) -> tuple[int, str]:
    """Return slot and button of a body's control: "trigger", "left_grip"."""
    side, _, button = control.rpartition("_")
    slot = RIGHT_CONTROLLER_SLOT - 1 if side == "left" else RIGHT_CONTROLLER_SLOT
    return slot, button


@dataclass
class Submission:
    """One image handed over: the frame's vertical sync, the eye (0 left) and the GL name, and the
    headset's pose (3 by 4) it is said to be drawn from; None for that of the frame.
    """

    vsync: int
    eye: int
    texture: int
    t_ns: int
    drawn_from: npt.NDArray[np.float32] | None = None


@dataclass
class _Counts:
    presents: int = 1
    mispresented_count: int = 0
    dropped_count: int = 0


@dataclass
class _Refusals:
    submit: int = 0
    haptics: list[tuple[int, int]] = field(default_factory=list)


class SimulatedVrRuntime:
    """Stand in for SteamVR in this process from `with` to its end.

    `trackers` maps serial numbers to the segments of a moving body they are worn on. Faults:
    standby, silence (tracking lost), disconnect (the headset is unplugged), loss and garbage
    (shares of poses), late_start (initialising is refused), version. With `running_start_ms` a
    frame is handed out that long before its vertical sync. Light leaves `look_ahead_ms` after the
    frame is handed out, at least at the next sync; None: `PHOTONS_S` after that. Only one such
    runtime can exist in a process at a time, and not together with a real one.
    """

    def __init__(
        self,
        body: Body,
        clock: Clock,
        *,
        seed: int = 0,
        display_rate_hz: float = 90.0,
        trackers: Mapping[str, str] | None = None,
        faults: FaultSchedule | None = None,
        running_start_ms: float = 0.0,
        look_ahead_ms: float | None = None,
    ) -> None:
        self._running_start_ns = round(running_start_ms * NS_PER_MS)
        self.on_submit: Callable[[int, int], None] | None = None
        self.on_image: Callable[[int, npt.NDArray[np.uint8]], None] | None = None
        self.submissions: list[Submission] = []
        self.axes: dict[int, dict[int, tuple[float, float]]] = {}
        self._body = body
        self._clock = clock
        self._rate_milli_hz = round(display_rate_hz * MILLI_HZ)
        self._photons_s = PHOTONS_S
        if look_ahead_ms is not None:
            until_sync_s = 1 / display_rate_hz + running_start_ms / 1000
            self._photons_s = max(0.0, look_ahead_ms / 1000 - until_sync_s)
        self._faults = faults if faults is not None else FaultSchedule()
        self._origin_ns = clock.now_ns()
        self._vsync = -1
        self._last_vsync = -1
        self._events: deque[tuple[int, str, int, str]] = deque()
        self._refusals = _Refusals()
        self._counts = _Counts()
        self._in_standby = self._is_unplugged = False
        self._submitted_eyes: set[int] = set()
        self._reader = ImageReader()
        self._world = SimulatedVrWorld(body, trackers or {}, self._faults, seed=seed)
        self.devices = self._world.devices
        self._environment: dict[str, str | None] = {}
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._native: Any = None
        self._openvr: Any = None
        self._tables: FunctionTables

    # ---- life ------------------------------------------------------------------------------

    def __enter__(self) -> "SimulatedVrRuntime":
        self._openvr = OPENVR.imported()
        client_library = build_library(
            "vrclient/vrclient.c", {"tables.h": table_header()}, "vrclient.so"
        )
        self._folder = tempfile.TemporaryDirectory(prefix="visavis-openvr-")
        root = Path(self._folder.name)
        place = root / "runtime" / "bin" / _platform_folder()
        place.mkdir(parents=True)
        library = place / "vrclient.so"
        library.symlink_to(client_library)
        paths = {"runtime": [str(root / "runtime")], "config": [str(root)], "log": [str(root)]}
        registry = root / "openvrpaths.vrpath"
        registry.write_text(json.dumps({**paths, "version": 1, "jsonid": "vrpathreg"}))
        self._set_environment("VR_PATHREG_OVERRIDE", str(registry))
        self._native = ctypes.CDLL(str(library))
        self._tables = FunctionTables(self._native)
        self._fill_tables()
        return self

    def __exit__(self, kind: object, problem: object, trace: object) -> None:
        for name, value in self._environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        if problem is None and self._tables.failure is not None:
            raise self._tables.failure

    def library(self, application: str = "scene") -> OpenVrLibrary:
        """Return the real library, which will find this runtime."""
        return OpenVrLibrary(self._clock, application=application)

    # ---- actions of a test or an operator ----------------------------------------------------

    def refuse_submit(self, error: int) -> None:
        """Answer every submission with this `EVRCompositorError`; 0 accepts again."""
        self._refusals.submit = error

    def refuse_init(self, error: int) -> None:
        """Refuse to initialise with this `EVRInitError`; 0 accepts again."""
        self._native.visavis_vr_set_init(error, 0)

    def quit(self) -> None:
        """Tell every program that the runtime closes."""
        self._push("quit", 0)

    def press(self, slot: int, button: str, *, down: bool, t_ns: int | None = None) -> None:
        """Press or release a button."""
        at_ns = self._clock.now_ns() if t_ns is None else t_ns
        self._events.append((at_ns, "press" if down else "release", slot, button))

    def move_eyes(self, ipd_m: float) -> None:
        """Turn the knob: move the eyes so far apart, and tell every program."""
        self._place_eyes(ipd_m)
        self._push("eyes_moved", 0)

    def swap_hands(self) -> None:
        """Let both controllers change hands, and tell every program."""
        controllers = [d for d in self.devices if d.kind == CONTROLLER]
        for device in controllers:
            device.role = 3 - device.role
            self._push("role_changed", self.devices.index(device))

    def move_base_station(self, number: int, offset_m: Vector) -> None:
        """Displace a base station for good."""
        self._world.base_offset_m[number] += offset_m

    def wear(self, trackers: Mapping[str, str]) -> None:
        """Put more trackers on segments of the body: serial number -> segment."""
        self._world.wear(trackers)
        self._name_devices()

    @property
    def failure(self) -> Exception | None:
        """The first error in a function called by C code."""
        return self._tables.failure

    @property
    def haptic_pulses(self) -> tuple[tuple[int, int], ...]:
        """Slot and microseconds of every requested pulse."""
        return tuple(self._refusals.haptics)

    @property
    def last_unmodelled(self) -> str:
        """Name of the last function called that is not modelled; empty for none."""
        self._native.visavis_vr_last_unmodelled.restype = ctypes.c_char_p
        return str(self._native.visavis_vr_last_unmodelled().decode())

    # ---- the world -------------------------------------------------------------------------

    def _follow_schedule(self, t_ns: int) -> None:
        since_ns = t_ns - self._origin_ns
        standby = self._faults.active("standby", since_ns) is not None
        if standby != self._in_standby:
            self._in_standby = standby
            self._push("standby" if standby else "awake", 0)
        is_unplugged = self._faults.active("disconnect", since_ns) is not None
        if is_unplugged != self._is_unplugged:
            self._is_unplugged = is_unplugged
            self.devices[0].is_connected = not is_unplugged
            self._push("deactivated" if is_unplugged else "activated", 0)

    def _push(self, kind: str, slot: int) -> None:
        self._events.append((self._clock.now_ns(), kind, slot, ""))

    # ---- the runtime's functions -------------------------------------------------------------

    def _wait_get_poses(self, render: Any, n: int, game: Any, m: int) -> int:
        scale = NS_PER_S * MILLI_HZ
        ready_ns = self._clock.now_ns() + self._running_start_ns
        due = -(-ready_ns * self._rate_milli_hz // scale)
        following = due if self._vsync < 0 else self._vsync + 1
        vsync = max(due, following)
        self._counts = _Counts(
            presents=vsync - self._vsync if self._vsync >= 0 else 1,
            mispresented_count=int(vsync > following),
            dropped_count=vsync - following,
        )
        self._vsync = vsync
        self._clock.sleep_until_ns(self._vsync_at_ns(vsync) - self._running_start_ns)
        self._submitted_eyes.clear()
        light_ns = self._vsync_at_ns(vsync + 1) + round(self._photons_s * NS_PER_S)
        self._write_poses(render, n, light_ns)
        if game:
            self._write_poses(game, m, light_ns + NS_PER_S * MILLI_HZ // self._rate_milli_hz)
        return 0

    def _write_poses(self, target: Any, n: int, t_ns: int) -> None:
        now_ns = self._clock.now_ns()
        self._follow_schedule(now_ns)
        since_ns = now_ns - self._origin_ns
        raw = self._world.poses(now_ns, max(t_ns, now_ns), since_ns, asleep=self._in_standby)
        ctypes.memmove(target, raw, min(n * POSE_BYTES, len(raw)))

    def _device_poses(self, universe: int, ahead_s: float, target: Any, n: int) -> None:
        self._write_poses(target, n, self._clock.now_ns() + round(ahead_s * NS_PER_S))

    def _submit(self, eye: int, texture: Any, bounds: Any, flags: int) -> int:
        if self._refusals.submit:
            return self._refusals.submit
        texture_data = texture.contents
        name = int(texture_data.handle or 0)
        if name == 0 or texture_data.eType != int(self._openvr.TextureType_OpenGL):
            return int(self._openvr.VRCompositorError_InvalidTexture)
        if eye in self._submitted_eyes:
            return int(self._openvr.VRCompositorError_AlreadySubmitted)
        if self.on_image is not None:
            try:
                image = self._reader.read(name)
            except DeviceError:
                return int(self._openvr.VRCompositorError_InvalidTexture)
            self.on_image(eye, image)
        self._submitted_eyes.add(eye)
        drawn_from = None
        if flags & int(self._openvr.Submit_TextureWithPose):
            pose_texture = ctypes.cast(
                texture, ctypes.POINTER(self._openvr.VRTextureWithPose_t)
            ).contents
            drawn_from = np.array(pose_texture.mDeviceToAbsoluteTracking.m, np.float32)
        now_ns = self._clock.now_ns()
        self.submissions.append(Submission(self._vsync, eye, name, now_ns, drawn_from))
        if self.on_submit is not None:
            self.on_submit(eye, name)
        return 0

    def _time_since_vsync(self, since_s: Any, count: Any) -> bool:
        if self._vsync < 0:
            return False
        now_ns, last = self._clock.now_ns(), self._vsync
        while self._vsync_at_ns(last) > now_ns:
            last -= 1
        since_s[0] = (now_ns - self._vsync_at_ns(last)) / NS_PER_S
        count[0] = last
        return True

    def _time_remaining(self) -> float:
        """Return the time to the sync that ends the frame; a frame is handed out before it begins.

        As the header says, the value rolls over by the running start before it reaches 0.
        """
        return (self._vsync_at_ns(self._vsync + 1) - self._clock.now_ns()) / NS_PER_S

    def _vsync_at_ns(self, number: int) -> int:
        return number * NS_PER_S * MILLI_HZ // self._rate_milli_hz

    def _frame_timing(self, timing: Any, ago: int) -> bool:
        if self._vsync < 0:
            return False
        row = timing.contents
        row.m_nFrameIndex = max(0, self._vsync - ago)
        row.m_nNumFramePresents = self._counts.presents
        row.m_nNumMisPresented = self._counts.mispresented_count
        row.m_nNumDroppedFrames = self._counts.dropped_count
        row.m_flTotalRenderGpuMs = 2.0
        return True

    def _poll_event(self, event: Any, size: int) -> bool:
        now_ns = self._clock.now_ns()
        for t_ns, control, value in self._body.presses(now_ns):
            slot, button = button_of(control)
            self.press(slot, button, down=value > 0.5, t_ns=t_ns)
        self._follow_schedule(now_ns)
        if not self._events:
            return False
        t_ns, kind, slot, button = self._events.popleft()
        raw = packed_event(size, kind, slot, (now_ns - t_ns) / NS_PER_S, button)
        ctypes.memmove(event, raw, size)
        return True

    def _float_property(self, slot: int, prop: int, error: Any) -> float:
        error[0] = 0
        if prop == 2002:
            return self._rate_milli_hz / MILLI_HZ
        if prop == 2001:
            return self._photons_s
        device = self._world.device(slot)
        if prop == 1012 and device is not None and device.battery_01 is not None:
            return device.battery_01
        error[0] = 4
        return 0.0

    def _bool_property(self, slot: int, prop: int, error: Any) -> bool:
        device = self._world.device(slot)
        error[0] = 0 if prop == 1010 and device is not None else 4
        return device is not None and device.battery_01 is not None

    def _activity(self, slot: int) -> int:
        return 3 if self._in_standby else 1

    def _controller_state(self, slot: int, state: Any, size: int) -> bool:
        device = self._world.device(slot)
        if device is None or device.kind != CONTROLLER or not device.is_connected:
            return False
        for axis, (x, y) in self.axes.get(slot, {}).items():
            state.contents.rAxis[axis].x, state.contents.rAxis[axis].y = x, y
        return True

    def _haptic(self, slot: int, axis: int, microseconds: int) -> None:
        self._refusals.haptics.append((slot, microseconds))

    def _projection_raw(self, eye: int, *targets: Any) -> None:
        for target, tangent in zip(targets, RAW_TANGENTS[eye != 0], strict=True):
            target[0] = tangent

    def _target_size(self, width: Any, height: Any) -> None:
        width[0], height[0] = RENDER_SIZE_PX

    # ---- tables -----------------------------------------------------------------------------

    def _fill_tables(self) -> None:
        vr = self._openvr
        system: dict[str, Callable[..., Any]] = {
            "getRecommendedRenderTargetSize": self._target_size,
            "getProjectionRaw": self._projection_raw,
            "getTimeSinceLastVsync": self._time_since_vsync,
            "getDeviceToAbsoluteTrackingPose": self._device_poses,
            "getTrackedDeviceActivityLevel": self._activity,
            "getControllerRoleForTrackedDeviceIndex": self._world.role_of,
            "getTrackedDeviceClass": self._world.class_of,
            "isTrackedDeviceConnected": self._world.is_connected,
            "getBoolTrackedDeviceProperty": self._bool_property,
            "getFloatTrackedDeviceProperty": self._float_property,
            "pollNextEvent": self._poll_event,
            "getControllerState": self._controller_state,
            "triggerHapticPulse": self._haptic,
        }
        compositor: dict[str, Callable[..., Any]] = {
            "setTrackingSpace": lambda universe: None,
            "waitGetPoses": self._wait_get_poses,
            "submit": self._submit,
            "getFrameTiming": self._frame_timing,
            "getFrameTimeRemaining": self._time_remaining,
        }
        self._tables.fill(0, vr.IVRSystem_FnTable, system)
        self._tables.fill(1, vr.IVRCompositor_FnTable, compositor)
        self._place_eyes(IPD_M)
        for eye in (0, 1):
            corners = [(u if eye == 0 else 1.0 - u, v) for three in HIDDEN_01 for u, v in three]
            flat = (ctypes.c_float * (2 * len(corners)))(*(x for uv in corners for x in uv))
            self._native.visavis_vr_set_hidden(eye, flat, len(HIDDEN_01))
        self._name_devices()
        version = self._faults.active("version", 0) is not None
        refusal = 108 if self._faults.active("late_start", 0) is not None else 0
        self._native.visavis_vr_set_init(refusal, int(version))

    def _place_eyes(self, ipd_m: float) -> None:
        for eye, sign in ((0, -1.0), (1, 1.0)):
            matrix = (ctypes.c_float * 12)(1, 0, 0, sign * ipd_m / 2, 0, 1, 0, 0, 0, 0, 1, 0)
            tangents = (ctypes.c_float * 4)(*RAW_TANGENTS[eye])
            self._native.visavis_vr_set_eye(eye, matrix, tangents)

    def _name_devices(self) -> None:
        for slot, device in enumerate(self.devices):
            for which, text in enumerate((device.serial, device.model, MAKER)):
                self._native.visavis_vr_set_text(slot, which, text.encode())

    def _set_environment(self, name: str, value: str) -> None:
        self._environment.setdefault(name, os.environ.get(name))
        os.environ[name] = value


def _platform_folder() -> str:
    return "linuxarm64" if platform.machine() in ("aarch64", "arm64") else "linux64"

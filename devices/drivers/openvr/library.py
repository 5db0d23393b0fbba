"""Call the OpenVR runtime through the `openvr` package, as a wire that can be logged and replayed.

A process has one connection to the runtime, so one `OpenVrLibrary` is shared by headset,
controllers and trackers; each gets its own `OpenVrTransport`. Every call is a request (its name,
its arguments) with an answer (the name of the error, empty for none, then what the runtime
filled in); events arrive as messages. So a `TeeTransport` around it can write a `.wire` log.

Requests: `runtime`, `devices`, `display`, `eye 0`, `eye 1`, `wait_poses`, `late`, `poses`,
`activity`, `submit 0`, `submit 1`, `axes`, `haptic`.
"""

import ctypes
import struct
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import msgpack

from visavis.devices.drivers.openvr.codec import MAX_DEVICES, VSYNC
from visavis.devices.drivers.runtimes.loader_output import loader_output_logged
from visavis.devices.libraries import OPENVR
from visavis.devices.transports import Exchange, Frames, Message, OnlyListening
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceError, DeviceNotFound

SIMULATED_RUNTIME = "Visavis"
"""A runtime whose version begins with this is our simulator."""

APPLICATIONS = {"scene": 1, "other": 0, "background": 3}

_INIT_REMEDY = "install and start SteamVR, connect the headset, and look at SteamVR's own messages"
INIT_REMEDIES = {
    "InitError_Init_PathRegistryNotFound": "SteamVR is not installed: install and start it once",
    "InitError_Init_InstallationNotFound": "SteamVR is not installed: install and start it once",
    "InitError_Init_VRClientDLLNotFound": "SteamVR is damaged: verify its files in Steam",
    "InitError_Init_InterfaceNotFound": "SteamVR is older than the openvr package: update SteamVR",
    "OpenVRError": "SteamVR speaks another version than the openvr package: update both",
    "InitError_Init_HmdNotFound": "connect and switch on the headset",
    "InitError_Init_NoServerForBackgroundApp": "start SteamVR first",
}


class OpenVrLibrary:
    """The connection of this process to the runtime, counted: the last to close shuts it down.

    `application` is "scene" to show images, "other" for trackers without a display,
    "background" to attach only to a SteamVR that runs already.
    """

    def __init__(self, clock: Clock, *, application: str = "scene") -> None:
        if application not in APPLICATIONS:
            names = ", ".join(APPLICATIONS)
            raise DeviceError(f"OpenVR application {application!r} is unknown", remedy=names)
        self.clock = clock
        self.is_simulated = False
        self.version = ""
        self._application = application
        self._users: list[OpenVrTransport] = []
        self._guard = threading.RLock()
        self._openvr: Any = None
        self._system: Any = None
        self._compositor: Any = None
        self._poses: Any = None
        self._calls: dict[str, Callable[[Frames], Frames]] = {
            "runtime": self._runtime,
            "devices": self._devices,
            "display": self._display,
            "eye": self._eye,
            "wait_poses": self._wait_poses,
            "late": self._late_pose,
            "poses": self._present_poses,
            "activity": self._activity,
            "submit": self._submit,
            "axes": self._axes,
            "haptic": self._haptic,
        }

    def transport(self) -> "OpenVrTransport":
        """Return a wire for one more device."""
        return OpenVrTransport(self)

    def show_images(self) -> None:
        """Connect as a scene application from now on; call it before any open."""
        self._application = "scene"

    def attach(self, user: "OpenVrTransport") -> None:
        """Connect for the first user; raises DeviceNotFound with a remedy."""
        with self._guard:
            if self._openvr is None:
                self._connect()
            if user not in self._users:
                self._users.append(user)

    def detach(self, user: "OpenVrTransport") -> None:
        """Disconnect after the last user."""
        with self._guard:
            if user in self._users:
                self._users.remove(user)
                if not self._users:
                    self._disconnect()

    def call(self, frames: Frames) -> Frames:
        """Perform one call; errors of the runtime are named in the answer."""
        if self._openvr is None:
            return (b"NotConnected",)
        name = frames[0].decode("ascii").partition(" ")[0]
        try:
            return (b"", *self._calls[name](frames))
        except self._openvr.error_code.OpenVRError as problem:
            return (type(problem).__name__.encode(),)

    def share_events(self) -> None:
        """Take the runtime's events and hand each to every user."""
        with self._guard:
            if self._openvr is None:
                return
            event = self._openvr.VREvent_t()
            while self._system.pollNextEvent(event):
                raw = bytes(event)
                message = Message(self.clock.now_ns(), (b"event", raw))
                for user in self._users:
                    user.inbox.append(message)
                if event.eventType == self._openvr.VREvent_Quit:
                    self._system.acknowledgeQuit_Exiting()
                    self._disconnect()
                    return

    # ---- connection -----------------------------------------------------------------------

    def _connect(self) -> None:
        openvr = OPENVR.imported()
        try:
            with loader_output_logged("OpenVR"):
                system = openvr.init(APPLICATIONS[self._application])
            compositor = openvr.VRCompositor() if self._application == "scene" else None
        except openvr.error_code.OpenVRError as cause:
            name = type(cause).__name__
            raise DeviceNotFound(
                f"the OpenVR runtime refused: {name} {cause}".rstrip(),
                remedy=INIT_REMEDIES.get(name, _INIT_REMEDY),
            ) from cause
        self._openvr, self._system, self._compositor = openvr, system, compositor
        self._poses = (openvr.TrackedDevicePose_t * MAX_DEVICES)()
        if compositor is not None:
            compositor.setTrackingSpace(openvr.TrackingUniverseStanding)
        self.version = _text(system.getRuntimeVersion())
        self.is_simulated = self.version.startswith(SIMULATED_RUNTIME)

    def _disconnect(self) -> None:
        if self._openvr is not None:
            self._openvr.shutdown()
        self._openvr = self._system = self._compositor = self._poses = None

    # ---- calls ----------------------------------------------------------------------------

    def _runtime(self, _: Frames) -> Frames:
        return (self.version.encode(),)

    def _devices(self, _: Frames) -> Frames:
        vr, system = self._openvr, self._system
        devices = []
        for slot in range(MAX_DEVICES):
            kind = int(system.getTrackedDeviceClass(slot))
            if kind and system.isTrackedDeviceConnected(slot):
                role = int(system.getControllerRoleForTrackedDeviceIndex(slot))
                texts = (vr.Prop_SerialNumber_String, vr.Prop_ModelNumber_String)
                maker = vr.Prop_ManufacturerName_String
                names = [self._property(slot, prop) for prop in (*texts, maker)]
                devices.append([slot, kind, role, *names, self._battery(slot)])
        payload: bytes = msgpack.packb(devices)
        return (payload,)

    def _property(self, slot: int, prop: Any) -> str:
        try:
            return str(self._system.getStringTrackedDeviceProperty(slot, prop))
        except self._openvr.error_code.OpenVRError:  # the device has no such property
            return ""

    def _battery(self, slot: int) -> float | None:
        vr = self._openvr
        try:
            if not self._system.getBoolTrackedDeviceProperty(slot, vr.Prop_DeviceIsWireless_Bool):
                return None
            level = self._system.getFloatTrackedDeviceProperty(
                slot, vr.Prop_DeviceBatteryPercentage_Float
            )
        except vr.error_code.OpenVRError:  # the device has no such property
            return None
        return float(level)

    def _display(self, _: Frames) -> Frames:
        vr, system = self._openvr, self._system
        rate_hz = system.getFloatTrackedDeviceProperty(0, vr.Prop_DisplayFrequency_Float)
        photons_s = system.getFloatTrackedDeviceProperty(0, vr.Prop_SecondsFromVsyncToPhotons_Float)
        width, height = system.getRecommendedRenderTargetSize()
        payload: bytes = msgpack.packb([float(rate_hz), float(photons_s), int(width), int(height)])
        return (payload,)

    def _eye(self, frames: Frames) -> Frames:
        eye = int(frames[0][-1:])
        tangents = [float(t) for t in self._system.getProjectionRaw(eye)]
        matrix = self._system.getEyeToHeadTransform(eye)
        mesh = self._system.getHiddenAreaMesh(eye, self._openvr.k_eHiddenAreaMesh_Standard)
        corners = mesh.pVertexData[: 3 * mesh.unTriangleCount] if mesh.pVertexData else []
        hidden_corners = [[float(corner.v[0]), float(corner.v[1])] for corner in corners]
        rows = [float(x) for row in matrix.m for x in row]
        payload: bytes = msgpack.packb([tangents, rows, hidden_corners])
        return (payload,)

    def _wait_poses(self, _: Frames) -> Frames:
        self._compositor.waitGetPoses(self._poses, None)
        poses = bytes(self._poses)
        is_known, since_s, count = self._system.getTimeSinceLastVsync()
        vsync = VSYNC.pack(bool(is_known), float(since_s), int(count))
        remaining = struct.pack("<d", self._compositor.getFrameTimeRemaining())
        has_timing, timing = self._compositor.getFrameTiming(1)
        (measured,) = self._pose_ahead(0.0)
        return poses, vsync, bytes(timing) if has_timing else b"", remaining, measured

    def _late_pose(self, frames: Frames) -> Frames:
        """Return the headset's pose as predicted now for a time in seconds ahead."""
        return self._pose_ahead(float(frames[1]))

    def _pose_ahead(self, ahead_s: float) -> Frames:
        poses = self._poses_here()
        self._system.getDeviceToAbsoluteTrackingPose(
            self._openvr.TrackingUniverseStanding, ahead_s, poses
        )
        return (bytes(poses[0]),)

    def _present_poses(self, _: Frames) -> Frames:
        self._system.getDeviceToAbsoluteTrackingPose(
            self._openvr.TrackingUniverseStanding, 0.0, self._poses_here()
        )
        return (bytes(self._poses_here()),)

    def _poses_here(self) -> Any:
        """Return an array of this thread: trackers and headset may poll at the same time."""
        local = _LOCAL.__dict__
        if "poses" not in local:
            local["poses"] = (self._openvr.TrackedDevicePose_t * MAX_DEVICES)()
        return local["poses"]

    def _activity(self, _: Frames) -> Frames:
        return (struct.pack("<i", int(self._system.getTrackedDeviceActivityLevel(0))),)

    def _submit(self, frames: Frames) -> Frames:
        """Hand over an image, with the headset's pose it was drawn from where that is given."""
        vr, flags = self._openvr, self._openvr.Submit_Default
        texture = vr.Texture_t(
            handle=int(frames[1]), eType=vr.TextureType_OpenGL, eColorSpace=vr.ColorSpace_Gamma
        )
        if len(frames) > 2:
            flags = vr.Submit_TextureWithPose
            texture = vr.VRTextureWithPose_t(
                texture.handle,
                texture.eType,
                texture.eColorSpace,
                vr.HmdMatrix34_t.from_buffer_copy(frames[2]),
            )
        # The package's own submit() cannot pass "the whole texture".
        error = self._compositor.function_table.submit(
            int(frames[0][-1:]), ctypes.byref(texture), None, flags
        )
        vr.error_code.CompositorError.check_error_value(error)
        return ()

    def _axes(self, frames: Frames) -> Frames:
        """Return the axes of the controllers in the given slots: x and y of five axes each."""
        rows = []
        for slot in (int(part) for part in frames[1].split()):
            is_known, state = self._system.getControllerState(slot)
            numbers = [float(v) for axis in state.rAxis for v in (axis.x, axis.y)]
            rows.append([slot, numbers if is_known else None])
        payload: bytes = msgpack.packb(rows)
        return (payload,)

    def _haptic(self, frames: Frames) -> Frames:
        slot, microseconds = (int(part) for part in frames[1].split())
        self._system.triggerHapticPulse(slot, 0, microseconds)
        return ()


_LOCAL = threading.local()


class OpenVrTransport(OnlyListening):
    """One device's wire to the shared library; follows `MessageTransport`."""

    kind = "openvr"

    def __init__(self, library: OpenVrLibrary) -> None:
        self._library = library
        self._clock = library.clock
        self.inbox: deque[Message] = deque()

    @property
    def is_simulated(self) -> bool:
        """Tell whether our simulated runtime answers; known once open."""
        return self._library.is_simulated

    def open(self, deadline_s: float) -> None:
        """Connect to the runtime; a runtime that hangs cannot be interrupted."""
        self.inbox.clear()
        self._library.attach(self)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Make a call and return what the runtime answered."""
        sent_ns = self._clock.now_ns()
        answer = self._library.call(frames)
        return Exchange(answer, sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Make a call and ignore its answer."""
        self._library.call(frames)

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the events since the last call; waits in steps of 1 ms for the first."""
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        self._library.share_events()
        while not self.inbox and (now_ns := self._clock.now_ns()) < deadline_ns:
            self._clock.sleep_until_ns(min(now_ns + NS_PER_MS, deadline_ns))
            self._library.share_events()
        messages = []
        while self.inbox:
            messages.append(self.inbox.popleft())
        return messages

    def close(self) -> None:
        """Leave the library; the last one disconnects."""
        self.inbox.clear()
        self._library.detach(self)


def _text(raw: Any) -> str:
    return raw.decode("utf-8", "replace") if isinstance(raw, bytes) else str(raw)

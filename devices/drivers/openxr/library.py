"""Call an OpenXR runtime through pyopenxr, as a wire that can be logged and replayed.

The session is headless (XR_MND_headless), tracks and shows nothing, unless `images` was posted
before it was opened: then it is bound to the OpenGL context that is current. A call is a request
(its name, its arguments) with an answer (the name of the error, empty for none, then packed
numbers), so that a `TeeTransport` around the transport writes a `.wire` log. One session serves
every device of the process. Times are XrTime (ns) as the runtime gives them, next to the same
instant on the session's clock (`visavis.devices.drivers.openxr.runtime_time`).

Requests: `images`, `runtime`, `gaze`, `eyes`, `hands`, `joints`, `frame`, `late`, `show`, `views`,
`hidden`, `size`, `buzz`.
"""

import contextlib
import ctypes
import struct
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgpack

from visavis.devices.drivers.openxr.actions import (
    BUTTON_STATES,
    HAND,
    HANDS,
    OpenXrActions,
    controller_extensions,
    supports_gaze,
)
from visavis.devices.drivers.openxr.eyes import (
    HTC,
    SUPPORTED,
    EyesOfRuntime,
    FbEyes,
    HtcEyes,
    extension_for_eyes,
    packed_eyes,
)
from visavis.devices.drivers.openxr.graphics import (
    VISIBILITY_MASK,
    EyeImages,
    GraphicsBinding,
    ask_graphics_requirements,
    hidden_area,
)
from visavis.devices.drivers.openxr.joints import HAND_TRACKING, HandJoints, supports_hands
from visavis.devices.drivers.openxr.packing import (
    FRAME,
    INSTANT,
    LATE,
    LOCATION,
    number,
    numbers,
    packed_views,
)
from visavis.devices.drivers.openxr.runtime_time import (
    RuntimeTime,
    performance_counter,
    time_extension,
)
from visavis.devices.drivers.openxr.wire import OpenXrTransport
from visavis.devices.drivers.runtimes.loader_output import loader_output_logged
from visavis.devices.libraries import OPENXR
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceNotFound

HEADLESS = "XR_MND_headless"
EYE_GAZE = "XR_EXT_eye_gaze_interaction"
SIMULATED_RUNTIME = "Visavis"
HEADLESS_RATE_HZ = 90.0
LOST = ("InstanceLostError", "SessionLostError")
"""Errors after which a runtime has to be connected to anew: it died, or let the session go."""

_NO_RUNTIME = (
    "install the headset's OpenXR runtime, start it once and make it the active one (for eye "
    "trackers the vendor's own runtime rather than SteamVR)"
)

_REFUSALS = {
    "RuntimeUnavailableError": ("there is no OpenXR runtime", _NO_RUNTIME),
    "FormFactorUnavailableError": (
        "the OpenXR runtime finds no headset",
        "connect and switch on the headset",
    ),
    "RuntimeFailureError": (
        "the OpenXR runtime does not answer",
        "start the headset's runtime, or its service, again",
    ),
    "ApiVersionUnsupportedError": (
        "the OpenXR runtime is older than OpenXR 1.0",
        "update the runtime",
    ),
}
"""Meaning and remedy of the runtime's errors while connecting, by the error's name."""


class OpenXrLibrary:
    """The session of this process with the runtime, counted: the last to close ends it."""

    def __init__(self, clock: Clock, *, counter: Callable[[], int] = performance_counter) -> None:
        self.clock = clock
        self._counter = counter
        self._time: RuntimeTime | None = None
        self.is_simulated = False
        self.version = ""
        self.offers_gaze = False
        self.eyes_by = ""
        self.tells_hidden = False
        self._eyes: EyesOfRuntime | None = None
        self._joints: HandJoints | None = None
        self.states: list[int] = []
        self.headless_rate_hz = HEADLESS_RATE_HZ
        """Frames per second that are counted where nothing is shown, and so nothing paces."""
        self._headless_frame = -1
        self._views_sent = b""
        self._users: list[OpenXrTransport] = []
        self._xr: Any = None
        self._instance: Any = None
        self._system: Any = None
        self._session: Any = None
        self._spaces: dict[str, Any] = {}
        self._actions: OpenXrActions | None = None
        self._shows_images = False
        self._binding: GraphicsBinding | None = None
        self._images: EyeImages | None = None
        self._display_time: Any = None
        self._running = False
        self._calls: dict[str, Callable[[Frames], Frames]] = {
            "runtime": self._runtime,
            "gaze": self._gaze,
            "eyes": self._both_eyes,
            "hands": self._hands,
            "joints": self._hand_joints,
            "frame": self._frame,
            "late": self._late,
            "show": self._show,
            "views": self._views,
            "hidden": self._hidden,
            "size": self._size,
            "buzz": self._buzz,
        }

    def transport(self) -> OpenXrTransport:
        """Return a wire for one more device."""
        return OpenXrTransport(self)

    def attach(self, user: OpenXrTransport, deadline_s: float) -> None:
        """Begin the session for the first user, and wait until it runs.

        A session that was begun and does not run yet is waited for by the next call: who looks for
        a runtime that was lost need not wait for it at a stretch.

        Raises:
            DeviceNotFound: there is no runtime, or it does not run by the deadline.
        """
        deadline_ns = self.clock.now_ns() + round(deadline_s * NS_PER_S)
        if self._instance is None:
            self._connect()
        if user not in self._users:
            self._users.append(user)
        with self._refusals_named():
            self._await_running(deadline_ns)

    def detach(self, user: OpenXrTransport) -> None:
        """End the session after the last user."""
        if user in self._users:
            self._users.remove(user)
            if not self._users:
                self._disconnect()

    def call(self, frames: Frames) -> Frames:
        """Perform one call; errors of the runtime are named in the answer."""
        if frames[0] == b"images":
            self._shows_images = True
            return (b"",)
        if self._instance is None:
            return (b"NotConnected",)
        try:
            self._pump_events()
            if not self._running:
                return (b"SessionNotRunning",)
            return (b"", *self._calls[frames[0].decode("ascii")](frames))
        except _CallRefusal as problem:
            return (str(problem).encode(),)
        except self._xr.exception.XrException as problem:
            if type(problem).__name__ in LOST:
                self._disconnect()  # nothing of it answers again; the next to open connects anew
            return (type(problem).__name__.encode(),)

    # ---- connection -----------------------------------------------------------------------

    def _connect(self) -> None:
        self._xr = OPENXR.imported()
        try:
            with self._refusals_named():
                self._begin()
        except BaseException:
            self._disconnect()
            raise

    @contextlib.contextmanager
    def _refusals_named(self) -> Iterator[None]:
        """Raise DeviceNotFound with a remedy for an error of the runtime, and let go of it."""
        try:
            yield
        except self._xr.exception.XrException as cause:
            self._disconnect()
            name = type(cause).__name__
            refusal = _REFUSALS.get(name, (f"the OpenXR runtime refused: {name}", _NO_RUNTIME))
            raise DeviceNotFound(refusal[0], remedy=refusal[1]) from cause

    def _begin(self) -> None:
        xr = self._xr
        # Choose extensions: a clock to convert is required; gaze, eyes and the mask are optional.
        with loader_output_logged("OpenXR"):
            offered_names = {p.extension_name for p in xr.enumerate_instance_extension_properties()}
        offered_names = {n.decode() if isinstance(n, bytes) else n for n in offered_names}
        if not self._shows_images and HEADLESS not in offered_names:
            raise DeviceNotFound(
                f"the OpenXR runtime does not offer {HEADLESS}",
                remedy="show images in the headset (display.show: headset), which does without; or "
                "use SteamVR or Monado as the OpenXR runtime",
            )
        timing = time_extension(offered_names)
        self._binding = GraphicsBinding(offered_names) if self._shows_images else None
        way = (HEADLESS,) if self._binding is None else self._binding.extensions
        per_eye = extension_for_eyes(offered_names)
        enabled_names = [*way, timing, *([EYE_GAZE] if EYE_GAZE in offered_names else [])]
        enabled_names += [per_eye] if per_eye else []
        enabled_names += [HAND_TRACKING] if HAND_TRACKING in offered_names else []
        self.tells_hidden = self._shows_images and VISIBILITY_MASK in offered_names
        enabled_names += [VISIBILITY_MASK] if self.tells_hidden else []
        enabled_names += controller_extensions(offered_names)
        application = xr.ApplicationInfo(
            application_name="Visavis", api_version=xr.Version(1, 0, 0)
        )
        create_info = xr.InstanceCreateInfo(
            application_info=application, enabled_extension_names=enabled_names
        )
        with loader_output_logged("OpenXR"):
            self._instance = xr.create_instance(create_info)
        self._time = RuntimeTime(xr, self._instance, self.clock, timing, self._counter)
        properties = xr.get_instance_properties(self._instance)
        name = properties.runtime_name
        self.version = name.decode() if isinstance(name, bytes) else str(name)
        self.is_simulated = self.version.startswith(SIMULATED_RUNTIME)
        # An extension that is enabled does not mean that this headset tracks eyes: ask the system.
        system = xr.get_system(
            self._instance, xr.SystemGetInfo(form_factor=xr.FormFactor.HEAD_MOUNTED_DISPLAY)
        )
        self._system = system
        self.offers_gaze = EYE_GAZE in enabled_names and supports_gaze(xr, self._instance, system)
        is_tracked = bool(per_eye) and SUPPORTED[per_eye](xr, self._instance, system)
        self.eyes_by = per_eye if is_tracked else ""
        # Graphics requirements must be asked for before the session, spaces come after it.
        link = None
        if self._binding is not None:
            ask_graphics_requirements(xr, self._instance, system)
            link = self._binding.link
        self._session = xr.create_session(
            self._instance, xr.SessionCreateInfo(system_id=system, next=link)
        )
        for space, kind in (
            ("stage", xr.ReferenceSpaceType.STAGE),
            ("view", xr.ReferenceSpaceType.VIEW),
        ):
            self._spaces[space] = xr.create_reference_space(
                self._session, xr.ReferenceSpaceCreateInfo(reference_space_type=kind)
            )
        if self.eyes_by == HTC:
            self._eyes = HtcEyes(xr, self._instance, self._session, self.clock)
        elif self.eyes_by:
            self._eyes = FbEyes(xr, self._session)
        if HAND_TRACKING in enabled_names and supports_hands(xr, self._instance, system):
            self._joints = HandJoints(xr, self._instance, self._session)
        self._actions = OpenXrActions(
            xr,
            self._instance,
            self._session,
            with_gaze=self.offers_gaze,
            extensions=enabled_names,
        )
        self._spaces.update(self._actions.spaces)
        if self._binding is not None:
            self._images = EyeImages(xr, self._session, self._spaces["stage"])

    def _await_running(self, deadline_ns: int) -> None:
        focus_state = int(self._xr.SessionState.FOCUSED.value)
        while focus_state not in self.states:
            self._pump_events()
            if self._instance is None:
                raise DeviceNotFound(
                    "the OpenXR runtime let the session go again",
                    remedy="look at the runtime; start it again if it is not running",
                )
            now_ns = self.clock.now_ns()
            if focus_state not in self.states and now_ns >= deadline_ns:
                raise DeviceNotFound(
                    "the OpenXR session did not get the focus in time",
                    remedy="close other VR programs and put the headset on",
                )
            if focus_state not in self.states:
                if self._running and self._images is not None:
                    self._begin_frame()  # only a session that submits frames gets the focus
                    self._end_frame()
                else:
                    self.clock.sleep_until_ns(now_ns + 5 * NS_PER_MS)

    def _pump_events(self) -> None:
        xr = self._xr
        while self._instance is not None:
            try:
                event = xr.poll_event(self._instance)
            except xr.exception.EventUnavailable:
                return
            raw = ctypes.string_at(ctypes.byref(event), 16)
            kind = struct.unpack_from("<i", raw)[0]
            if kind != int(xr.StructureType.EVENT_DATA_SESSION_STATE_CHANGED.value):
                continue
            state_change = ctypes.cast(
                ctypes.byref(event), ctypes.POINTER(xr.EventDataSessionStateChanged)
            ).contents
            self._follow(int(state_change.state.value))

    def _follow(self, state: int) -> None:
        xr = self._xr
        self.states.append(state)
        if state == int(xr.SessionState.READY.value):
            xr.begin_session(
                self._session,
                xr.SessionBeginInfo(
                    primary_view_configuration_type=xr.ViewConfigurationType.PRIMARY_STEREO
                ),
            )
            self._running = True
        elif state == int(xr.SessionState.STOPPING.value):
            self._running = False
            xr.end_session(self._session)
        elif state in (
            int(xr.SessionState.LOSS_PENDING.value),
            int(xr.SessionState.EXITING.value),
        ):
            self._running = False
            self._disconnect()

    def _disconnect(self) -> None:
        """Release everything; destroying the instance destroys its children."""
        instance, self._instance = self._instance, None
        images, self._images, self._display_time = self._images, None, None
        if images is not None and not images.close():
            instance = None  # with it go images whose context is gone: leave them to the process
        self._session, self._actions, self._binding, self._time = None, None, None, None
        self._eyes, self.eyes_by, self._joints = None, "", None
        self._spaces, self.states, self._running = {}, [], False
        self._headless_frame = -1
        if instance is not None:
            # what is left of a runtime that died may refuse even this
            with contextlib.suppress(self._xr.exception.XrException):
                self._xr.destroy_instance(instance)

    # ---- calls ----------------------------------------------------------------------------

    def _now(self) -> tuple[int, int]:
        """Return one instant on the session's clock and on the runtime's."""
        if self._time is None:
            raise _CallRefusal("NotConnected")
        return self._time.now()

    def _runtime(self, _: Frames) -> Frames:
        tracks_hands = self._joints is not None
        facts = [self.version, self.offers_gaze, self.eyes_by, self.tells_hidden, tracks_hands]
        payload: bytes = msgpack.packb(facts)
        return (payload,)

    def _locate(self, space: str, base: str, at: int, next_struct: Any = None) -> tuple[int, Any]:
        xr = self._xr
        link = (
            None
            if next_struct is None
            else ctypes.cast(ctypes.pointer(next_struct), ctypes.c_void_p)
        )
        location = xr.SpaceLocation(next=link)
        result = xr.raw_functions.xrLocateSpace(
            self._spaces[space], self._spaces[base], xr.Time(at), ctypes.byref(location)
        )
        problem = xr.check_result(xr.Result(result))
        if problem.is_exception():
            raise problem
        flags = ctypes.cast(
            ctypes.byref(location, xr.SpaceLocation._location_flags.offset),  # noqa: SLF001 - the package's field
            ctypes.POINTER(ctypes.c_uint64),
        )[0]
        return int(flags), location.pose

    def _gaze(self, _: Frames) -> Frames:
        if not self.offers_gaze or self._actions is None:
            return ()
        self._actions.sync()
        host_ns, now = self._now()
        sample_time = self._xr.EyeGazeSampleTimeEXT()
        flags, pose = self._locate("gaze", "view", now, sample_time)
        payload = LOCATION.pack(host_ns, now, int(number(sample_time.time)), flags, *numbers(pose))
        return (payload,)

    def _both_eyes(self, _: Frames) -> Frames:
        if self._eyes is None:
            return ()
        host_ns, now = self._now()
        sample_time, eyes = self._eyes.read(self._spaces["view"], now)
        return (packed_eyes(host_ns, now, sample_time, eyes),)

    def _hands(self, _: Frames) -> Frames:
        actions = self._actions
        if actions is None:
            return ()
        actions.sync()
        host_ns, now = self._now()
        parts = [INSTANT.pack(host_ns, now)]
        for hand, name in enumerate(HANDS):
            trigger_01 = actions.trigger(hand)
            flags, pose = self._locate(f"aim {name}", "stage", now)
            parts.append(BUTTON_STATES.pack(*actions.buttons(hand)))
            axis_state = (trigger_01 is not None, 0.0 if trigger_01 is None else trigger_01)
            parts.append(HAND.pack(*axis_state, flags, *numbers(pose)))
        return (b"".join(parts),)

    def _hand_joints(self, _: Frames) -> Frames:
        if self._joints is None:
            return ()
        host_ns, now = self._now()
        return (self._joints.read(self._spaces["stage"], host_ns, now),)

    def _buzz(self, frames: Frames) -> Frames:
        hand, duration_us = (int(part) for part in frames[1].split())
        if self._actions is not None:
            self._actions.buzz(hand, duration_us)
        return ()

    def _begin_frame(self) -> tuple[int, int]:
        """Wait for a frame and begin it; return its predicted display time and its period."""
        if self._display_time is not None:
            self._end_frame()
        state = self._xr.wait_frame(self._session)
        self._xr.begin_frame(self._session)
        self._display_time = state.predicted_display_time
        return int(number(self._display_time)), int(number(state.predicted_display_period))

    def _next_headless(self) -> tuple[int, int]:
        """Wait for a tick of our own; return the runtime's time one period later, and the period.

        A headless session has no frames: xrBeginFrame needs graphics, and the display time of
        xrWaitFrame means nothing (XR_MND_headless). Monado refuses the one and sets no other.
        """
        # Ticks lie on the grid k / rate of the session's clock, which does not drift.
        scale, rate_mhz = NS_PER_S * 1000, round(self.headless_rate_hz * 1000)
        frame = max(-(-self.clock.now_ns() * rate_mhz // scale), self._headless_frame + 1)
        self._headless_frame = frame
        self.clock.sleep_until_ns(frame * scale // rate_mhz)
        period_ns = round(scale / rate_mhz)
        return self._now()[1] + period_ns, period_ns

    def _end_frame(self, layers: Sequence[Any] = ()) -> None:
        xr, display_time, self._display_time = self._xr, self._display_time, None
        xr.end_frame(
            self._session,
            xr.FrameEndInfo(
                display_time=display_time,
                environment_blend_mode=xr.EnvironmentBlendMode.OPAQUE,
                layers=list(layers),
            ),
        )

    def _frame(self, _: Frames) -> Frames:
        if self._images is None:
            display_time, period = self._next_headless()
        else:
            display_time, period = self._begin_frame()
        flags, pose = self._locate("view", "stage", display_time)
        host_ns, now = self._now()
        payload = FRAME.pack(host_ns, now, display_time, period, flags, *numbers(pose))
        has_focus = bool(self.states) and self.states[-1] == int(
            self._xr.SessionState.FOCUSED.value
        )
        now_flags, now_pose = self._locate("view", "stage", now)
        measured = LATE.pack(now_flags, *numbers(now_pose))
        answer = (payload, b"1" if has_focus else b"0", measured)
        if self._images is None:
            return answer
        # The eyes may be moved apart at any time; what changed goes with the frame.
        views = self._located_views(display_time)
        is_new, self._views_sent = views != self._views_sent, views
        return (*answer, views) if is_new else answer

    def _late(self, _: Frames) -> Frames:
        """Predict the head once more for the frame that has begun."""
        if self._display_time is None:
            raise _CallRefusal("NoFrameBegun")
        flags, pose = self._locate("view", "stage", int(number(self._display_time)))
        return (LATE.pack(flags, *numbers(pose)),)

    def _show(self, frames: Frames) -> Frames:
        """End the frame with two new images, or with the last ones."""
        if self._images is None or self._display_time is None:
            raise _CallRefusal("NoFrameToShowImagesIn")
        if len(frames) > 1 and (problem := self._images.take(frames[1])):
            raise _CallRefusal(problem)
        self._end_frame(self._images.layers)
        return ()

    def _size(self, _: Frames) -> Frames:
        """Return the width and height the runtime recommends for an eye's image."""
        xr = self._xr
        kind = xr.ViewConfigurationType.PRIMARY_STEREO
        view = xr.enumerate_view_configuration_views(self._instance, self._system, kind)[0]
        size = [view.recommended_image_rect_width, view.recommended_image_rect_height]
        payload: bytes = msgpack.packb([int(n) for n in size])
        return (payload,)

    def _hidden(self, _: Frames) -> Frames:
        """Return the areas hidden by the lenses: corners (tangents), three per triangle."""
        if not self.tells_hidden or self._session is None:
            raise _CallRefusal("NothingToldOfHiddenAreas")
        xr = self._xr
        address = xr.get_instance_proc_addr(self._instance, "xrGetVisibilityMaskKHR")
        ask = ctypes.cast(address, xr.PFN_xrGetVisibilityMaskKHR)
        both = [hidden_area(xr, ask, self._session, eye) for eye in (0, 1)]
        payload: bytes = msgpack.packb(both)
        return (payload,)

    def _views(self, _: Frames) -> Frames:
        self._views_sent = self._located_views(self._now()[1])
        return (self._views_sent,)

    def _located_views(self, at: int) -> bytes:
        """Return how both eyes look at a time of the runtime, in the head's space."""
        xr = self._xr
        _, views = xr.locate_views(
            self._session,
            xr.ViewLocateInfo(
                view_configuration_type=xr.ViewConfigurationType.PRIMARY_STEREO,
                display_time=xr.Time(at),
                space=self._spaces["view"],
            ),
        )
        return packed_views(views)


class _CallRefusal(Exception):
    """A call refused here, before it reaches the runtime."""

"""Ask an OpenXR runtime for either eye: XR_HTC_eye_tracker and XR_FB_eye_tracking_social.

Meta's gives a ray and a confidence per eye, HTC's a ray, the pupil's diameter and the openness of
the eye. The first is in Khronos' registry and so in pyopenxr. The second is only in HTC's own
plugins; its numbers, structures and functions are taken from there.
"""

import ctypes
import math
import struct
from collections.abc import Callable, Iterable
from typing import Any, ClassVar, NamedTuple, Protocol

from visavis.devices.drivers.openxr.packing import number, numbers
from visavis.lab.clock import NS_PER_S, Clock

HTC, FB = "XR_HTC_eye_tracker", "XR_FB_eye_tracking_social"
PER_EYE = (HTC, FB)
"""Extensions with rays per eye, the one with more values first."""

EYES = struct.Struct("<qqq" + 2 * "?10f")
"""Host ns and XrTime of one instant, XrTime of the sample (0: unknown); of the left and the right
eye: valid, position, quaternion (x, y, z, w), confidence, pupil (mm), openness; NaN: unknown."""

RETRY_NS = NS_PER_S
"""Wait after a refusal: a tracker that has not started must not be asked again at once."""


class EyeReading(NamedTuple):
    """One eye in the head's view space: the numbers of its pose, and its other values."""

    valid: bool
    pose: tuple[float, ...]
    confidence_01: float = math.nan
    pupil_mm: float = math.nan
    openness_01: float = math.nan


class EyesOfRuntime(Protocol):
    """Either eye of a running session."""

    def read(self, space: Any, now: int) -> tuple[int, tuple[EyeReading, EyeReading]]:
        """Return the sample's XrTime (0: unknown) and both eyes relative to a space."""
        ...


def extension_for_eyes(offered_extensions: Iterable[str]) -> str:
    """Return the best extension with rays per eye; empty where a runtime has none."""
    names = set(offered_extensions)
    return next((name for name in PER_EYE if name in names), "")


def packed_eyes(host_ns: int, now: int, sample_time: int, eyes: Iterable[EyeReading]) -> bytes:
    """Return both eyes for the wire."""
    values: list[Any] = []
    for eye in eyes:
        values += [eye.valid, *eye.pose, eye.confidence_01, eye.pupil_mm, eye.openness_01]
    return EYES.pack(host_ns, now, sample_time, *values)


# ---- Meta -----------------------------------------------------------------------------------


class FbEyes:
    """Eyes by XR_FB_eye_tracking_social."""

    def __init__(self, xr: Any, session: Any) -> None:
        self._xr = xr
        self._tracker = xr.create_eye_tracker_fb(session)

    def read(self, space: Any, now: int) -> tuple[int, tuple[EyeReading, EyeReading]]:
        """Return the sample's time and both eyes."""
        xr = self._xr
        info = xr.EyeGazesInfoFB(base_space=space, time=now)
        gazes = xr.get_eye_gazes_fb(self._tracker, info)
        left, right = (
            EyeReading(bool(eye.is_valid), numbers(eye.gaze_pose), float(eye.gaze_confidence))
            for eye in gazes.gaze
        )
        return int(number(gazes.time)), (left, right)


def supports_fb(xr: Any, instance: Any, system: Any) -> bool:
    """Tell whether the headset of a system tracks either eye, by Meta's extension."""
    properties = xr.SystemEyeTrackingPropertiesFB()
    system_properties(xr, instance, system, properties)
    return bool(properties.supports_eye_tracking)


# ---- HTC ------------------------------------------------------------------------------------


class _Head(ctypes.Structure):
    _fields_: ClassVar[Any] = (("type", ctypes.c_int32), ("next", ctypes.c_void_p))


class _Supports(_Head):
    _fields_ = (("supports_eye_tracking", ctypes.c_uint32),)


class _GazeInfo(_Head):
    _fields_ = (("base_space", ctypes.c_void_p), ("time", ctypes.c_int64))


class _EyeGaze(ctypes.Structure):
    _fields_ = (
        ("is_valid", ctypes.c_uint32),
        ("turn", ctypes.c_float * 4),
        ("place", ctypes.c_float * 3),
    )


class _EyePupil(ctypes.Structure):
    _fields_ = (
        ("is_diameter_valid", ctypes.c_uint32),
        ("is_position_valid", ctypes.c_uint32),
        ("diameter_mm", ctypes.c_float),
        ("on_sensor", ctypes.c_float * 2),
    )


class _EyeShape(ctypes.Structure):
    _fields_ = (
        ("is_valid", ctypes.c_uint32),
        ("openness", ctypes.c_float),
        ("wide", ctypes.c_float),
        ("squeeze", ctypes.c_float),
    )


class _Gaze(_Head):
    _fields_ = (("time", ctypes.c_int64), ("eyes", _EyeGaze * 2))


class _Pupils(_Head):
    _fields_ = (("time", ctypes.c_int64), ("eyes", _EyePupil * 2))


class _Shapes(_Head):
    _fields_ = (("time", ctypes.c_int64), ("eyes", _EyeShape * 2))


CREATE_INFO, GAZE_INFO, GAZE, SUPPORTS = 1000326001, 1000326002, 1000326003, 1000326005
PUPIL_INFO, PUPILS, SHAPE_INFO, SHAPES = 1000326006, 1000326007, 1000326009, 1000326010
"""Structure types: those of extension 327."""
_CALL = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p)
"""All of its functions that are used take a handle and two pointers."""


class HtcEyes:
    """Eyes by XR_HTC_eye_tracker."""

    def __init__(self, xr: Any, instance: Any, session: Any, clock: Clock) -> None:
        self._xr = xr
        self._clock = clock
        self._retry_ns = 0

        def function(name: str) -> Callable[..., int]:
            address = xr.get_instance_proc_addr(instance, name)
            return ctypes.cast(address, _CALL)

        self._gaze = function("xrGetEyeGazeDataHTC")
        self._pupils = function("xrGetEyePupilDataHTC")
        self._shapes = function("xrGetEyeGeometricDataHTC")
        tracker = ctypes.c_uint64()
        create = function("xrCreateEyeTrackerHTC")
        info = _Head(CREATE_INFO)
        self._check(
            create(ctypes.cast(session, ctypes.c_void_p), ctypes.byref(info), ctypes.byref(tracker))
        )
        self._tracker = ctypes.c_void_p(tracker.value)

    def read(self, space: Any, now: int) -> tuple[int, tuple[EyeReading, EyeReading]]:
        """Return the sample's time and both eyes, which are lost until `RETRY_NS` after a refusal.

        Raises:
            XrException: the runtime refused, for the first time since `RETRY_NS`.
        """
        if self._clock.now_ns() < self._retry_ns:
            lost_eye = EyeReading(False, (0.0,) * 6 + (1.0,))
            return now, (lost_eye, lost_eye)
        info = _GazeInfo(GAZE_INFO, None, ctypes.cast(space, ctypes.c_void_p), now)
        gaze, pupils, shapes = _Gaze(GAZE), _Pupils(PUPILS), _Shapes(SHAPES)
        gaze.time = pupils.time = shapes.time = now
        try:
            self._ask(self._gaze, info, gaze)
            self._ask(self._pupils, _Head(PUPIL_INFO), pupils)
            self._ask(self._shapes, _Head(SHAPE_INFO), shapes)
        except self._xr.exception.XrException:
            self._retry_ns = self._clock.now_ns() + RETRY_NS
            raise
        left, right = (
            EyeReading(
                bool(eye_gaze.is_valid),
                (*eye_gaze.place, *eye_gaze.turn),
                pupil_mm=pupil.diameter_mm if pupil.is_diameter_valid else math.nan,
                openness_01=shape.openness if shape.is_valid else math.nan,
            )
            for eye_gaze, pupil, shape in zip(gaze.eyes, pupils.eyes, shapes.eyes, strict=True)
        )
        return int(gaze.time), (left, right)

    def _ask(self, function: Callable[..., int], info: Any, answer: Any) -> None:
        self._check(function(self._tracker, ctypes.byref(info), ctypes.byref(answer)))

    def _check(self, result: int) -> None:
        problem = self._xr.check_result(self._xr.Result(result))
        if problem.is_exception():
            raise problem


def supports_htc(xr: Any, instance: Any, system: Any) -> bool:
    """Tell whether the headset of a system tracks either eye, by HTC's extension."""
    properties = _Supports(SUPPORTS)
    system_properties(xr, instance, system, properties)
    return bool(properties.supports_eye_tracking)


SUPPORTED: dict[str, Callable[[Any, Any, Any], bool]] = {HTC: supports_htc, FB: supports_fb}


def system_properties(xr: Any, instance: Any, system: Any, next_struct: Any) -> None:
    """Let the runtime fill in what an extension tells of a system."""
    properties = xr.SystemProperties(next=ctypes.cast(ctypes.pointer(next_struct), ctypes.c_void_p))
    result = xr.raw_functions.xrGetSystemProperties(instance, system, ctypes.byref(properties))
    problem = xr.check_result(xr.Result(result))
    if problem.is_exception():
        raise problem

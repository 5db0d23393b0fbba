"""Carry eye frames out of FoveClient, the vendor's library, by ctypes.

A thread waits in the library for eye frames and stamps each when the wait returns; everything
else is called under one lock. Frames and answers are the messages of a wire, so they can be teed
to a `.wire` log and replayed without the library.
"""

import ctypes
import struct
import threading
from collections.abc import Callable
from typing import Any

from visavis.devices.drivers.fove.codec import (
    DISCONNECTED_WITH,
    EYE_FRAME,
    NO_UPDATE,
    OK,
    TIMED_OUT,
    error_text,
)
from visavis.devices.library_wire import LibraryWire
from visavis.devices.transports import Exchange, Frames, Message
from visavis.lab.clock import Clock
from visavis.lab.errors import DeviceNotFound, ProtocolViolation

CAPABILITIES = 8 | 32 | 1 << 14
"""Eye tracking, presence of a user, pupil radius."""

SERVICE_REMEDY = "start the FOVE runtime, connect the headset, and try again"
LIBRARY_REMEDY = (
    "install the FOVE runtime and write the full path of its FoveClient library under "
    "`library_path`"
)
ANSWER = struct.Struct("<ii")
HASH_BYTES = 64


class _Vec3(ctypes.Structure):
    _fields_ = [(axis, ctypes.c_float) for axis in "xyz"]


class _Ray(ctypes.Structure):
    _fields_ = [("origin", _Vec3), ("direction", _Vec3)]


class _FrameTimestamp(ctypes.Structure):
    _fields_ = [("id", ctypes.c_uint64), ("us", ctypes.c_uint64)]


class _Versions(ctypes.Structure):
    """Versions as FoveAPI.h lists them: hashes are arrays in the structure, not pointers."""

    _fields_ = [
        *(
            (f"client_{part}", ctypes.c_int)
            for part in ("major", "minor", "build", "year", "month", "day", "protocol")
        ),
        ("client_hash", ctypes.c_char * HASH_BYTES),
        *(
            (f"runtime_{part}", ctypes.c_int)
            for part in ("major", "minor", "build", "year", "month", "day")
        ),
        ("runtime_hash", ctypes.c_char * HASH_BYTES),
        ("firmware", ctypes.c_int),
        ("max_firmware", ctypes.c_int),
        ("min_firmware", ctypes.c_int),
        ("too_old_headset", ctypes.c_bool),
        ("spare", ctypes.c_char * 256),  # a later library may write more than is read
    ]


class FoveLibrary(LibraryWire):
    """Offer one headset of a loaded FoveClient as a message transport."""

    def __init__(self, library_path: str, clock: Clock, *, is_simulated: bool = False) -> None:
        super().__init__(library_path, clock, remedy=SERVICE_REMEDY, is_simulated=is_simulated)
        self._headset = ctypes.c_void_p()
        self._calls = threading.Lock()

    def open(self, deadline_s: float) -> None:
        """Load the library, make a headset, check versions, begin to wait for frames."""
        self.close()
        try:
            self._library = ctypes.CDLL(self._path)
        except OSError as cause:
            raise DeviceNotFound(
                f"the FoveClient library at {self._path!r} cannot be loaded ({cause})",
                remedy=LIBRARY_REMEDY,
            ) from cause
        try:
            create = self._library.fove_createHeadset
        except AttributeError as cause:
            raise DeviceNotFound(
                f"{self._path!r} is not a FoveClient library of version 1", remedy=LIBRARY_REMEDY
            ) from cause
        headset = ctypes.c_void_p()
        self._must(create(CAPABILITIES, ctypes.byref(headset)))
        self._headset = headset
        self._must(self._call("registerCapabilities", ctypes.c_int(CAPABILITIES)))
        self._begin_to_fetch("fove-frames")

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Call what the first frame names; the answer is that name, code and value, text."""
        sent_ns = self._clock.now_ns()
        answer = (frames[0], *self._answers[frames[0]](self))
        return Exchange(answer, sent_ns, self._clock.now_ns())

    def close(self) -> None:
        """End the thread and destroy the headset; idempotent."""
        self._stop_fetching()
        if self._headset:
            self._call("destroy")
            self._headset = ctypes.c_void_p()
        self._library = None

    def _fetch(self) -> None:
        wait = self._library.fove_Headset_waitForProcessedEyeFrame
        while not self._stopping.is_set():
            code = wait(self._headset)  # blocks, without the lock and without Python's
            now_ns = self._clock.now_ns()
            if self._stopping.is_set() or code == TIMED_OUT:
                continue
            frame = None
            if code == OK:
                with self._calls:
                    code, frame = self._eye_frame()
            if frame is not None:
                self._arrivals.add(Message(now_ns, (frame,)))
            elif code in DISCONNECTED_WITH:
                self._arrivals.end(error_text(code))
                return
            else:  # refused at once: do not spin
                self._arrivals.add()
                self._stopping.wait(0.005)

    def _eye_frame(self) -> tuple[int, bytes | None]:
        stamp = _FrameTimestamp()
        code = self._call("fetchEyeTrackingData", ctypes.byref(stamp))
        if code != OK:
            return (code, None)
        vector, ray = _Vec3(), _Ray()
        state, radius = ctypes.c_int(), ctypes.c_float()
        values: list[float] = [stamp.id, stamp.us]
        for eye in (0, 1):
            values += [self._call("getGazeVector", eye, ctypes.byref(vector))]
            values += [vector.x, vector.y, vector.z]
            values += [self._call("getEyeState", eye, ctypes.byref(state)), state.value]
            values += [self._call("getPupilRadius", eye, ctypes.byref(radius)), radius.value]
        values += [self._call("getCombinedGazeRay", ctypes.byref(ray))]
        values += [ray.origin.x, ray.origin.y, ray.origin.z]
        values += [ray.direction.x, ray.direction.y, ray.direction.z]
        return OK, EYE_FRAME.pack(*values)

    def _call(self, name: str, *arguments: Any) -> int:
        function = getattr(self._library, f"fove_Headset_{name}")
        return int(function(self._headset, *arguments))

    def _must(self, code: int) -> None:
        if code == OK or code == NO_UPDATE:
            return
        if code in (4, 6):
            raise ProtocolViolation(
                error_text(code), remedy="install runtime and library of one version"
            )
        raise DeviceNotFound(error_text(code), remedy=SERVICE_REMEDY)

    def _flag(self, name: str) -> Frames:
        value = ctypes.c_bool()
        with self._calls:
            code = self._call(name, ctypes.byref(value))
        return (ANSWER.pack(code, int(value.value)),)

    def _versions(self) -> Frames:
        versions = _Versions()
        with self._calls:
            code = self._call("getSoftwareVersions", ctypes.byref(versions))
            if code == OK:
                code = self._call("checkSoftwareVersions")
        client = f"{versions.client_major}.{versions.client_minor}.{versions.client_build}"
        runtime = f"{versions.runtime_major}.{versions.runtime_minor}.{versions.runtime_build}"
        return ANSWER.pack(code, 0), f"client {client}, runtime {runtime}".encode()

    def _calibration_state(self) -> Frames:
        state = ctypes.c_int()
        with self._calls:
            code = self._call("getEyeTrackingCalibrationState", ctypes.byref(state))
        return (ANSWER.pack(code, state.value),)

    def _start_calibration(self) -> Frames:
        with self._calls:
            return (ANSWER.pack(self._call("startEyeTrackingCalibration", None), 0),)

    _answers: dict[bytes, Callable[["FoveLibrary"], Frames]] = {  # noqa: RUF012 - never changed
        b"versions": _versions,
        b"hardware": lambda self: self._flag("isHardwareConnected"),
        b"calibrated": lambda self: self._flag("isEyeTrackingCalibrated"),
        b"present": lambda self: self._flag("isUserPresent"),
        b"start_calibration": _start_calibration,
        b"calibration_state": _calibration_state,
    }

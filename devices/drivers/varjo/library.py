"""Carry eye data out of Varjo's native library by ctypes.

The library keeps gaze until it is fetched. A thread fetches it more often than it comes and passes
every datum on as a message of a wire, stamped when it was fetched; everything is called under one
lock. Questions: `start`, `time` (`varjo_GetCurrentTime`), `state`, `calibrate`.
"""

import ctypes
import struct
import threading
from collections.abc import Callable
from typing import Any

from visavis.devices.drivers.varjo.codec import GAZE, MEASUREMENTS, STATE
from visavis.devices.library_wire import LibraryWire
from visavis.devices.transports import Exchange, Frames, Message
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceNotFound

FETCH_EVERY_NS = NS_PER_S // 500
AT_ONCE = 16
HELD_DATA = 10_000
TIME = struct.Struct("<q")

CALIBRATING, CALIBRATED, ALLOWED = 0xA000, 0xA001, 0xA003
QUALITY_LEFT, QUALITY_RIGHT, HMD_CONNECTED = 0xA004, 0xA005, 0xE001
"""Keys of the system's properties."""
UNSUPPORTED = 105
"""The error of a parameter that this headset does not have."""

LIBRARY_REMEDY = (
    "install Varjo Base and write the full path of VarjoLib.dll (of the native SDK) under "
    "`library_path`"
)
RUNTIME_REMEDY = "start Varjo Base, connect the headset, and allow eye tracking in its settings"


class _Parameter(ctypes.Structure):
    _fields_ = [("key", ctypes.c_char_p), ("value", ctypes.c_char_p)]


class VarjoLibrary(LibraryWire):
    """Offer the eye tracker of a loaded VarjoLib as a message transport.

    `is_smoothed` asks for the vendor's filter; without it gaze comes as it was measured.
    """

    def __init__(
        self,
        library_path: str,
        clock: Clock,
        *,
        is_smoothed: bool = False,
        is_simulated: bool = False,
    ) -> None:
        super().__init__(
            library_path, clock, remedy=RUNTIME_REMEDY, most=HELD_DATA, is_simulated=is_simulated
        )
        self._filter = b"Standard" if is_smoothed else b"None"
        self._session = ctypes.c_void_p()
        self._calls = threading.Lock()
        self._gaze = ctypes.create_string_buffer(GAZE.size * AT_ONCE)
        self._measurements = ctypes.create_string_buffer(MEASUREMENTS.size * AT_ONCE)

    def open(self, deadline_s: float) -> None:
        """Load the library, begin a session and its eye tracking; raises DeviceNotFound."""
        self.close()
        library = self._loaded()
        if not library.varjo_IsAvailable():
            raise DeviceNotFound("Varjo's system is not available", remedy=RUNTIME_REMEDY)
        session = library.varjo_SessionInit()
        if not session:
            raise DeviceNotFound("Varjo's system begins no session", remedy=RUNTIME_REMEDY)
        self._library, self._session = library, ctypes.c_void_p(session)
        try:
            self._begin_gaze()
        except DeviceNotFound:
            self.close()
            raise
        self._begin_to_fetch("varjo-gaze")

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Call what the first frame names; the answer is that name and what was returned."""
        with self._calls:
            sent_ns = self._clock.now_ns()
            answer = self._answers[frames[0]](self)
            received_ns = self._clock.now_ns()
        return Exchange((frames[0], answer), sent_ns, received_ns)

    def close(self) -> None:
        """End the thread and the session; idempotent."""
        self._stop_fetching()
        library, self._library = self._library, None
        if library is not None:
            library.varjo_SessionShutDown(self._session)

    def _loaded(self) -> Any:
        try:
            library = ctypes.CDLL(self._path)
            library.varjo_SessionInit.restype = ctypes.c_void_p
            library.varjo_GetVersionString.restype = ctypes.c_char_p
            library.varjo_GetErrorDesc.restype = ctypes.c_char_p
            library.varjo_GetErrorDesc.argtypes = [ctypes.c_int64]
            library.varjo_GetError.restype = ctypes.c_int64
            library.varjo_GetCurrentTime.restype = ctypes.c_int64
            for name in ("Bool", "Int"):
                function = getattr(library, f"varjo_GetProperty{name}")
                function.argtypes = [ctypes.c_void_p, ctypes.c_int64]
            library.varjo_GetGazeDataArray.argtypes = [
                ctypes.c_void_p,
                ctypes.c_void_p,
                ctypes.c_void_p,
                ctypes.c_int32,
            ]
        except OSError as cause:
            text = f"Varjo's library at {self._path!r} cannot be loaded ({cause})"
            raise DeviceNotFound(text, remedy=LIBRARY_REMEDY) from cause
        except AttributeError as cause:
            text = f"{self._path!r} is not a VarjoLib of native SDK 3.5 or later"
            raise DeviceNotFound(text, remedy=LIBRARY_REMEDY) from cause
        return library

    def _begin_gaze(self) -> None:
        library = self._library
        if not library.varjo_IsGazeAllowed(self._session):
            raise DeviceNotFound("eye tracking is not allowed", remedy=RUNTIME_REMEDY)
        parameters = (_Parameter * 2)(
            _Parameter(b"OutputFilterType", self._filter),
            _Parameter(b"OutputFrequency", b"OutputFrequencyMaximumSupported"),
        )
        library.varjo_GazeInitWithParameters(self._session, parameters, ctypes.c_int32(2))
        error = library.varjo_GetError(self._session)
        if error == UNSUPPORTED:  # an older headset has one rate and one filter
            library.varjo_GazeInit(self._session)
            error = library.varjo_GetError(self._session)
        if error:
            text = (library.varjo_GetErrorDesc(error) or b"").decode("utf-8", "replace")
            raise DeviceNotFound(
                f"Varjo's eye tracking does not start: {text} (error {error})",
                remedy=RUNTIME_REMEDY,
            )

    def _fetch(self) -> None:
        has_error = False
        while not self._stopping.is_set():
            with self._calls:
                count = self._library.varjo_GetGazeDataArray(
                    self._session, self._gaze, self._measurements, AT_ONCE
                )
                now_ns = self._clock.now_ns()
                error = 0 if count else self._library.varjo_GetError(self._session)
            if bool(error) != has_error:
                has_error = bool(error)
                self._arrivals.end(f"Varjo gives no gaze (error {error})" if error else "")
            gaze, measured = self._gaze.raw, self._measurements.raw
            self._arrivals.add(
                *(
                    Message(now_ns, (_part(gaze, i, GAZE) + _part(measured, i, MEASUREMENTS),))
                    for i in range(count)
                )
            )
            if count < AT_ONCE:
                self._clock.sleep_until_ns(now_ns + FETCH_EVERY_NS)

    def _start(self) -> bytes:
        return bytes(self._library.varjo_GetVersionString() or b"")

    def _time(self) -> bytes:
        return TIME.pack(self._library.varjo_GetCurrentTime(self._session))

    def _state(self) -> bytes:
        library = self._library
        library.varjo_SyncProperties(self._session)
        flags = (
            bool(library.varjo_GetPropertyBool(self._session, key))
            for key in (ALLOWED, HMD_CONNECTED, CALIBRATING, CALIBRATED)
        )
        qualities = (
            library.varjo_GetPropertyInt(self._session, key)
            for key in (QUALITY_LEFT, QUALITY_RIGHT)
        )
        return STATE.pack(*flags, *qualities)

    def _calibrate(self) -> bytes:
        self._library.varjo_RequestGazeCalibration(self._session)
        return TIME.pack(self._library.varjo_GetError(self._session))

    _answers: dict[bytes, Callable[["VarjoLibrary"], bytes]] = {  # noqa: RUF012 - never changed
        b"start": _start,
        b"time": _time,
        b"state": _state,
        b"calibrate": _calibrate,
    }


def _part(data: bytes, number: int, layout: struct.Struct) -> bytes:
    return data[number * layout.size : (number + 1) * layout.size]

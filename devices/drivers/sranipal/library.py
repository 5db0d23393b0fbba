"""Carry eye data out of SRanipal, the vendor's library, by ctypes.

The library only answers when asked. A thread asks it more often than frames come and passes on
every frame once, stamped when it was first seen, as a message of a wire. `start` asks whether the
headset is a Vive Pro Eye.
"""

import ctypes

from visavis.devices.drivers.sranipal.codec import EYE_DATA
from visavis.devices.library_wire import LibraryWire
from visavis.devices.transports import Exchange, Frames, Message
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceNotFound

EYE_V2 = 2
"""The kind of module: eyes, second version of the data."""
WORK = 0
ASK_EVERY_NS = NS_PER_S // 500
HELD_FRAMES = 10_000
NUMBER = slice(4, 8)
"""Bytes of the frame number."""
SPARE_BYTES = 256
"""A later library may write more bytes than are read."""
LIBRARY_REMEDY = "install SR_Runtime and write the full path of SRanipal.dll under library_path"
RUNTIME_REMEDY = "start SR_Runtime as administrator, and SteamVR with the headset connected"


class SranipalLibrary(LibraryWire):
    """Offer the eye tracker of a loaded SRanipal as a message transport."""

    def __init__(self, library_path: str, clock: Clock, *, is_simulated: bool = False) -> None:
        super().__init__(
            library_path, clock, remedy=RUNTIME_REMEDY, most=HELD_FRAMES, is_simulated=is_simulated
        )
        self._data = ctypes.create_string_buffer(EYE_DATA.size + SPARE_BYTES)

    def open(self, deadline_s: float) -> None:
        """Load the library and start its eye module; raises DeviceNotFound with a remedy."""
        self.close()
        try:
            library = ctypes.CDLL(self._path)
            start = library.Initial
            library.IsViveProEye.restype = ctypes.c_bool
        except OSError as cause:
            text = f"SRanipal at {self._path!r} cannot be loaded ({cause})"
            raise DeviceNotFound(text, remedy=LIBRARY_REMEDY) from cause
        except AttributeError as cause:
            text = f"{self._path!r} is not an SRanipal library"
            raise DeviceNotFound(text, remedy=LIBRARY_REMEDY) from cause
        error = start(ctypes.c_int(EYE_V2), None)
        if error != WORK:
            text = f"SRanipal does not start its eye module (error {error})"
            raise DeviceNotFound(text, remedy=RUNTIME_REMEDY)
        self._library = library
        self._begin_to_fetch("sranipal")

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Say whether the headset is a Vive Pro Eye."""
        sent_ns = self._clock.now_ns()
        is_vive_pro_eye = self._library is not None and self._library.IsViveProEye()
        return Exchange((frames[0], bytes((is_vive_pro_eye,))), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Do nothing: every question waits for its answer."""

    def close(self) -> None:
        """End the thread and release the eye module; idempotent."""
        self._stop_fetching()
        library, self._library = self._library, None
        if library is not None:
            library.Release(ctypes.c_int(EYE_V2))

    def _fetch(self) -> None:
        last, before = b"", WORK
        while not self._stopping.is_set():
            error = self._library.GetEyeData_v2(self._data)
            now_ns = self._clock.now_ns()
            raw = self._data.raw[: EYE_DATA.size]
            number = raw[NUMBER]
            if error != before:
                before = error
                problem = "" if error == WORK else f"SRanipal gives no eye data (error {error})"
                self._arrivals.end(problem)
            if error == WORK and number != last:
                last = number
                self._arrivals.add(Message(now_ns, (raw,)))
            self._clock.sleep_until_ns(now_ns + ASK_EVERY_NS)

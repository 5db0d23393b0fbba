"""Carry EyeLink samples out of pylink, the vendor's library, on an optional extra.

The link's own protocol is private, so the library's surface is the wire: what its functions give
becomes messages that can be teed to a `.wire` log and replayed without it.
"""

import importlib
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from devices.drivers.eyelink.codec import LEFT, NO_TIME, RIGHT, SAMPLE, message_text
from devices.transports import Exchange, Frames, Message
from lab.clock import NS_PER_MS, NS_PER_S, Clock
from lab.errors import DeviceDisconnected, DeviceNotFound, DeviceTimeout

SAMPLE_TYPE = 200
LOOK_AGAIN_NS = NS_PER_MS // 5
MOST_SAMPLES = 4096
TIME = struct.Struct("<q")
VERDICT = struct.Struct("<i")


def eyelink_library() -> Any:
    """Return SR Research's pylink; raises DeviceNotFound with the command that installs it."""
    try:
        library = importlib.import_module("pylink")
    except ImportError as cause:
        raise DeviceNotFound(
            "the library pylink of SR Research is not installed",
            remedy="run: pip install visavis[eyelink]",
        ) from cause
    if not hasattr(library, "EyeLink"):
        raise DeviceNotFound(
            "the module 'pylink' belongs to another package than SR Research's",
            remedy="run: pip uninstall pylink pylink-square, then pip install sr-research-pylink",
        )
    return library


class EyeLinkLibrary:
    """Offer one tracker's link samples; `library` stands in for pylink in tests.

    With `edf_path`, the tracker records to its own file, which is fetched there when closed.
    """

    def __init__(
        self,
        address: str,
        clock: Clock,
        *,
        edf_path: Path | None = None,
        library: Any = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._address = address
        self._clock = clock
        self._edf_path = edf_path
        self._given = library
        self._tracker: Any = None

    @property
    def kind(self) -> str:
        """Name the address."""
        return f"pylink {self._address}"

    def open(self, deadline_s: float) -> None:
        """Connect and begin to record samples to the link."""
        self.close()
        library = self._given if self._given is not None else eyelink_library()
        try:
            tracker = library.EyeLink(self._address)
        except RuntimeError as cause:
            raise DeviceNotFound(f"no EyeLink answers at {self._address} ({cause})") from cause
        self._tracker = tracker
        self._must_be_there()
        if self._edf_path is not None:
            tracker.openDataFile("visavis.edf")
        to_file = int(self._edf_path is not None)
        tracker.sendCommand("link_sample_data = LEFT,RIGHT,GAZE,AREA,STATUS")
        code = tracker.startRecording(to_file, to_file, 1, 0)
        if code:
            self.close()
            raise DeviceNotFound(f"the EyeLink does not start to record (code {code})")

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Ask (time,), (version,) or (verdict,)."""
        self._must_be_there()
        tracker = self._tracker
        sent_ns = self._clock.now_ns()
        if frames[0] == b"time":
            time_us = int(tracker.trackerTimeUsec())
            if time_us < 0 or time_us // 1000 >= NO_TIME or time_us == NO_TIME:
                raise DeviceTimeout("the EyeLink does not know its time")
            answer = TIME.pack(time_us * 1000)
        elif frames[0] == b"version":
            answer = str(tracker.getTrackerVersionString()).encode()
        else:
            text = str(tracker.getCalibrationMessage())
            answer = VERDICT.pack(int(tracker.getCalibrationResult())) + text.encode()
        return Exchange((frames[0], answer), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Do nothing: the library answers at once, so the driver asks by `request`."""

    def subscribe(self, port: int, topics: Sequence[bytes]) -> None:
        """Do nothing: samples come since open."""

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return the samples in the library's queue; waits in steps of a fifth of a millisecond."""
        self._must_be_there()
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while True:
            messages = self._drain()
            now_ns = self._clock.now_ns()
            if messages or now_ns >= deadline_ns:
                return messages
            self._clock.sleep_until_ns(min(now_ns + LOOK_AGAIN_NS, deadline_ns))
            self._must_be_there()

    def send(self, port: int, frames: Frames) -> None:
        """Write a message into the tracker's recording."""
        self._must_be_there()
        self._tracker.sendMessage(message_text(frames[0].decode()))

    def close(self) -> None:
        """Stop, fetch the tracker's file, and disconnect; idempotent."""
        tracker, self._tracker = self._tracker, None
        if tracker is None:
            return
        try:
            if tracker.isConnected() > 0:
                tracker.stopRecording()
                if self._edf_path is not None:
                    tracker.closeDataFile()
                    tracker.receiveDataFile("visavis.edf", str(self._edf_path))
        except RuntimeError:
            self._edf_path = None  # the link broke: the file stays on the tracker's computer
        finally:
            tracker.close()

    def _drain(self) -> list[Message]:
        tracker = self._tracker
        messages: list[Message] = []
        while len(messages) < MOST_SAMPLES:
            kind = tracker.getNextData()
            if not kind:
                break
            if kind != SAMPLE_TYPE:
                continue
            now_ns = self._clock.now_ns()
            sample = tracker.getFloatData()
            if sample is not None:
                messages.append(Message(now_ns, (_packed(sample),)))
        return messages

    def _must_be_there(self) -> None:
        if self._tracker is None or self._tracker.isConnected() <= 0:
            raise DeviceDisconnected(f"the EyeLink at {self._address} is not connected")


def _packed(sample: Any) -> bytes:
    eyes = 0
    numbers: list[float] = []
    for bit, present, eye in (
        (LEFT, sample.isLeftSample() or sample.isBinocular(), sample.getLeftEye),
        (RIGHT, sample.isRightSample() or sample.isBinocular(), sample.getRightEye),
    ):
        found = eye() if present else None
        if found is None:
            numbers += [-32768.0, -32768.0, 0.0]
            continue
        eyes |= bit
        numbers += [*map(float, found.getGaze()), float(found.getPupilSize())]
    return SAMPLE.pack(float(sample.getTime()), eyes, *numbers)

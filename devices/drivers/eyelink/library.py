"""Carry EyeLink samples out of pylink, the vendor's library, on an optional extra.

The link's own protocol is private, so the library's functions serve as the wire: their results
become messages that can be copied to a `.wire` log and replayed without the library.
"""

import string
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from visavis.devices.drivers.eyelink.codec import (
    LEFT,
    NO_REPLY,
    NO_TIME,
    RIGHT,
    SAMPLE,
    TARGET,
    message_text,
    screen_coordinates,
)
from visavis.devices.libraries import PYLINK
from visavis.devices.transports import Exchange, Frames, Message, NoTopics
from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound, DeviceTimeout

SAMPLE_TYPE = 200
LOOK_AGAIN_NS = NS_PER_MS // 5
MAX_SAMPLES = 4096
MODE_READY_MS = 500
KEY_PRESS, ENTER = 10, 13
"""A key that goes down, and the key that accepts, as the library numbers them."""
DRIFT_COMMANDS = ("driftcorrect_cr_disable = OFF", "online_dcorr_maxangle = 5.0")
TIME = struct.Struct("<q")
VERDICT = struct.Struct("<i")


def eyelink_library() -> Any:
    """Return SR Research's pylink; raises DeviceNotFound with the command that installs it."""
    library = PYLINK.imported()
    if not hasattr(library, "EyeLink"):
        raise DeviceNotFound(
            "the module 'pylink' belongs to another package than SR Research's",
            remedy="run: pip uninstall pylink pylink-square, then pip install sr-research-pylink",
        )
    return library


class EyeLinkLibrary(NoTopics):
    """Offer one tracker's link samples; `library` replaces pylink in tests.

    `screen_px` is sent to the tracker, whose gaze is in these pixels. It is told to give a pupil's
    diameter, or with `gives_area` its area; the names of the data say AREA for both. After a
    request `record` it records to its own file, which is fetched when the wire is closed.
    `setup` ends the recording and lets the host calibrate, `target` says what it shows, `leave`
    accepts the result and records again; `drift` shifts gaze onto a pixel.
    """

    def __init__(
        self,
        address: str,
        clock: Clock,
        *,
        screen_px: tuple[int, int] = (1920, 1080),
        rate_hz: float = 1000.0,
        gives_area: bool = False,
        corrects_drift: bool = False,
        library: Any = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._address = address
        self._clock = clock
        self._screen_px = screen_px
        self._rate_hz = rate_hz
        self._gives_area = gives_area
        self._corrects_drift = corrects_drift
        self._file: tuple[str, Path] | None = None
        self._breaks = 0
        self._injected_library = library
        self._tracker: Any = None

    @property
    def kind(self) -> str:
        """Name the address."""
        return f"pylink {self._address}"

    def open(self, deadline_s: float) -> None:
        """Connect and begin to record samples to the link."""
        self.close()
        library = (
            self._injected_library if self._injected_library is not None else eyelink_library()
        )
        try:
            tracker = library.EyeLink(self._address)
        except RuntimeError as cause:
            raise DeviceNotFound(f"no EyeLink answers at {self._address} ({cause})") from cause
        self._tracker = tracker
        self._must_be_there()
        tracker.setOfflineMode()
        coordinates = screen_coordinates(self._screen_px)
        for command in (
            f"screen_pixel_coords = {coordinates}",
            f"sample_rate = {self._rate_hz:.0f}",
            f"pupil_size_diameter = {'NO' if self._gives_area else 'YES'}",
            "link_sample_data = LEFT,RIGHT,GAZE,AREA,STATUS",
            "file_event_filter = LEFT,RIGHT,FIXATION,SACCADE,BLINK,MESSAGE,BUTTON,INPUT",
            "file_sample_data = LEFT,RIGHT,GAZE,AREA,GAZERES,HREF,STATUS,INPUT",
            *(DRIFT_COMMANDS if self._corrects_drift else ()),
        ):
            tracker.sendCommand(command)
        if self._file is not None:
            # The link broke: the host keeps its file, and the recording goes on in another.
            name, path = self._file
            self._breaks += 1
            mark = string.ascii_uppercase[min(self._breaks, 26) - 1]
            self._open_file(f"{name[:7]}{mark}", path.with_stem(f"{path.stem}_{mark}"))
        else:
            self._start(0)

    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Answer (time,), (version,) or (verdict,); with (record, name, path), begin to record."""
        self._must_be_there()
        tracker = self._tracker
        sent_ns = self._clock.now_ns()
        if frames[0] == b"time":
            return self._exchange_time(timeout_s)
        if frames[0] == b"record":
            tracker.stopRecording()
            tracker.setOfflineMode()
            self._open_file(frames[1].decode(), Path(frames[2].decode()))
            answer = b""
        elif frames[0] == b"setup":
            answer = self._begin_setup()
        elif frames[0] == b"target":
            hidden, x, y = tracker.getTargetPositionAndState()
            code = int(tracker.getCalibrationResult())
            answer = TARGET.pack(int(hidden == 0), round(x), round(y), code)
        elif frames[0] == b"leave":
            answer = self._leave_setup()
        elif frames[0] == b"drift":
            answer = VERDICT.pack(self._correct_drift(frames[1].decode(), timeout_s))
        elif frames[0] == b"version":
            answer = str(tracker.getTrackerVersionString()).encode()
        else:
            text = str(tracker.getCalibrationMessage())
            answer = VERDICT.pack(int(tracker.getCalibrationResult())) + text.encode()
        return Exchange((frames[0], answer), sent_ns, self._clock.now_ns())

    def post(self, frames: Frames) -> None:
        """Do nothing: the library answers at once, so the driver asks by `request`."""

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
                tracker.setOfflineMode()
                if self._file is not None:
                    name, path = self._file
                    tracker.closeDataFile()
                    tracker.receiveDataFile(f"{name}.edf", str(path))
                    self._file = None
        except RuntimeError:
            return  # the link broke: the file stays on the host computer, under the session's name
        finally:
            tracker.close()

    def _open_file(self, name: str, path: Path) -> None:
        tracker = self._tracker
        code = tracker.openDataFile(f"{name}.edf")
        if code:
            raise DeviceError(
                f"the host computer cannot open the file {name}.edf (code {code})",
                remedy="look at the disk of the EyeLink's host computer",
            )
        self._file = (name, path)
        tracker.sendMessage(f"DISPLAY_COORDS {screen_coordinates(self._screen_px)}")
        self._start(1)

    def _begin_setup(self) -> bytes:
        tracker = self._tracker
        tracker.stopRecording()
        tracker.setOfflineMode()
        tracker.enableAutoCalibration()
        tracker.startSetup()
        tracker.waitForModeReady(MODE_READY_MS)
        tracker.sendKeybutton(ord("c"), 0, KEY_PRESS)
        return b""

    def _leave_setup(self) -> bytes:
        self._tracker.sendKeybutton(ENTER, 0, KEY_PRESS)
        self._tracker.setOfflineMode()
        self._start(int(self._file is not None))
        return b""

    def _correct_drift(self, place: str, timeout_s: float) -> int:
        tracker = self._tracker
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        tracker.sendCommand(f"online_dcorr_trigger {place}")
        while (code := int(tracker.commandResult())) == NO_REPLY:
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                break
            self._clock.sleep_until_ns(now_ns + LOOK_AGAIN_NS)
        return code

    def _start(self, to_file: int) -> None:
        code = self._tracker.startRecording(to_file, to_file, 1, 0)
        if code:
            self.close()
            raise DeviceNotFound(f"the EyeLink does not start to record (code {code})")

    def _exchange_time(self, timeout_s: float) -> Exchange:
        """Ask the tracker itself: its own estimate on this computer is not an exchange."""
        tracker = self._tracker
        deadline_ns = self._clock.now_ns() + round(timeout_s * NS_PER_S)
        while tracker.readTime():  # an answer that came too late for an earlier question
            pass
        sent_ns = self._clock.now_ns()
        if tracker.requestTime():
            raise DeviceDisconnected(f"the EyeLink at {self._address} takes no question")
        while not (time_ms := int(tracker.readTime())):
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout("the EyeLink does not tell its time")
            self._clock.sleep_until_ns(min(now_ns + LOOK_AGAIN_NS // 4, deadline_ns))
        received_ns = self._clock.now_ns()
        if not 0 < time_ms < NO_TIME:
            raise DeviceTimeout("the EyeLink does not know its time")
        # The tracker answers in whole milliseconds: take the middle of that millisecond.
        answer = TIME.pack(time_ms * NS_PER_MS + NS_PER_MS // 2)
        return Exchange((b"time", answer), sent_ns, received_ns)

    def _drain(self) -> list[Message]:
        tracker = self._tracker
        messages: list[Message] = []
        while len(messages) < MAX_SAMPLES:
            kind = tracker.getNextData()
            if not kind:
                break
            if kind != SAMPLE_TYPE:
                continue
            now_ns = self._clock.now_ns()
            sample = tracker.getFloatData()
            if sample is not None:
                messages.append(Message(now_ns, (_pack_sample(sample),)))
        return messages

    def _must_be_there(self) -> None:
        if self._tracker is None or self._tracker.isConnected() <= 0:
            raise DeviceDisconnected(f"the EyeLink at {self._address} is not connected")


def _pack_sample(sample: Any) -> bytes:
    eyes = 0
    numbers: list[float] = []
    for bit, present, eye in (
        (LEFT, sample.isLeftSample() or sample.isBinocular(), sample.getLeftEye),
        (RIGHT, sample.isRightSample() or sample.isBinocular(), sample.getRightEye),
    ):
        eye_data = eye() if present else None
        if eye_data is None:
            numbers += [-32768.0, -32768.0, 0.0]
            continue
        eyes |= bit
        numbers += [*map(float, eye_data.getGaze()), float(eye_data.getPupilSize())]
    return SAMPLE.pack(float(sample.getTime()), eyes, *numbers)

"""A stand-in of the part of pylink that the EyeLink driver calls, over its simulator.

The library's core needs a tracker, so nothing below pylink's surface is modelled; nor are events,
the camera's picture and the content of EDF files.
"""

import re
from pathlib import Path
from typing import Any

from visavis.devices.sim.eyelink import SAMPLE, VERSION, EyeLinkSimulator
from visavis.lab.clock import Clock

DEFAULT_PX = (1280, 1024)
"""The display pixels that a host computer assumes until it gets others."""
EDF_NAME = re.compile(r"[A-Z0-9_]{1,8}\.EDF")


class FakePylink:
    """Stand in for the module `pylink`: only its `EyeLink` class, over a simulator.

    `files` holds the messages of each file on the host computer, by its name; messages sent while
    none was open are lost.
    """

    def __init__(self, simulator: EyeLinkSimulator, clock: Clock) -> None:
        self.simulator = simulator
        self.clock = clock
        self.files: dict[str, list[str]] = {}

    def EyeLink(self, address: str) -> "FakeTracker":  # noqa: N802 - the library's own name
        """Connect, or raise as the library does when nobody answers."""
        if self.simulator.source.is_away(self.clock.now_ns()):
            raise RuntimeError("link terminated")
        return FakeTracker(self)


class FakeTracker:
    """The methods of pylink's EyeLink that the transport calls, with its conventions."""

    def __init__(self, library: FakePylink) -> None:
        self._library = library
        self._waiting: list[bytes] = []
        self._next: bytes | None = None
        self.recording = False
        self.commands: list[str] = []
        self._is_offline = self._in_setup = False
        self.keys: list[int] = []
        self._open: str | None = None
        self._answer_ns: int | None = None
        library.simulator.display_px = DEFAULT_PX
        library.simulator.gives_area = True  # until it is told otherwise

    def isConnected(self) -> int:  # noqa: N802
        """Return 1 while the link stands."""
        return 0 if self._library.simulator.source.is_away(self._library.clock.now_ns()) else 1

    def sendCommand(self, command: str) -> int:  # noqa: N802
        """Take a command; pixels and rate hold from the next recording on."""
        self.commands.append(command)
        if not self.recording and command.startswith("screen_pixel_coords"):
            left, top, right, bottom = map(int, command.partition("=")[2].split())
            self._library.simulator.display_px = (right - left + 1, bottom - top + 1)
        if not self.recording and command.startswith("pupil_size_diameter"):
            self._library.simulator.gives_area = command.partition("=")[2].strip() != "YES"
        return 0

    def setOfflineMode(self) -> None:  # noqa: N802
        """Leave setup or recording."""
        if self._in_setup:
            self._in_setup = False
            self._library.simulator.leave_setup(self._library.clock.now_ns())
        self._is_offline, self.recording = True, False

    def enableAutoCalibration(self) -> None:  # noqa: N802
        """Let the host accept fixations by itself."""

    def startSetup(self) -> int:  # noqa: N802
        """Show the host's menu; needs offline mode."""
        if not self._is_offline:
            return -1
        self._in_setup, self._is_offline = True, False
        return 0

    def waitForModeReady(self, most_ms: int) -> int:  # noqa: N802
        """Return 0: the mode has changed."""
        return 0

    def sendKeybutton(self, code: int, mods: int, state: int) -> int:  # noqa: N802
        """Press a key at the host: C in its menu calibrates."""
        self.keys.append(code)
        if self._in_setup and code == ord("c"):
            self._library.simulator.begin_setup(self._library.clock.now_ns())
        return 0

    def getTargetPositionAndState(self) -> tuple[int, int, int]:  # noqa: N802
        """Return 0 for a target that is visible, and its place."""
        is_shown, x, y, _ = self._library.simulator.target(self._library.clock.now_ns())
        return 1 - is_shown, x, y

    def commandResult(self) -> int:  # noqa: N802
        """Return the result of the last command."""
        return self._library.simulator.drift_code

    def startRecording(self, *flags: int) -> int:  # noqa: N802
        """Start; older samples are lost. Nothing is recorded while no file is open."""
        if not self._is_offline or (flags[0] and self._open is None):
            return -1
        self.recording, self._is_offline = True, False
        self._library.simulator.advance(self._library.clock.now_ns())
        self._library.simulator.outgoing(self._library.clock.now_ns())
        return 0

    def stopRecording(self) -> None:  # noqa: N802
        """Stop."""
        self.recording = False

    def openDataFile(self, name: str) -> int:  # noqa: N802
        """Open a file on the host computer; needs offline mode and a valid name."""
        if not self._is_offline or EDF_NAME.fullmatch(name.upper()) is None:
            return -1
        self._open = name
        self._library.files[name] = []
        return 0

    def closeDataFile(self) -> int:  # noqa: N802
        """Close it."""
        self._open = None
        return 0

    def receiveDataFile(self, name: str, path: str) -> int:  # noqa: N802
        """Copy a closed file to this computer."""
        if name not in self._library.files or self._open is not None:
            raise RuntimeError("no such file, or it is open")
        if Path(path).exists():
            raise RuntimeError("the file exists already")
        content = "\n".join(["SR_RESEARCH_SIMULATED", *self._library.files[name]]).encode()
        Path(path).write_bytes(content)
        return len(content)

    def getNextData(self) -> int:  # noqa: N802
        """Return 200 when a sample is next, 0 when nothing is."""
        simulator, now_ns = self._library.simulator, self._library.clock.now_ns()
        simulator.advance(now_ns)
        self._waiting += [message.frames[0] for message in simulator.outgoing(now_ns)]
        while self._waiting:
            self._next = self._waiting.pop(0)
            if len(self._next) == SAMPLE.size:
                return 200
        return 0

    def getFloatData(self) -> "FakeSample | None":  # noqa: N802
        """Return the sample that was announced."""
        return None if self._next is None else FakeSample(self._next)

    def requestTime(self) -> int:  # noqa: N802
        """Ask the host for its time; the answer is read later."""
        simulator, now_ns = self._library.simulator, self._library.clock.now_ns()
        if not simulator.source.is_unresponsive(now_ns):
            self._asked_ns = now_ns + simulator.leg_ns()
            self._answer_ns = self._asked_ns + simulator.leg_ns()
        return 0

    def readTime(self) -> int:  # noqa: N802
        """Return the host's time in whole milliseconds, once; 0 while there is none."""
        if self._answer_ns is None or self._library.clock.now_ns() < self._answer_ns:
            return 0
        self._answer_ns = None
        return self._library.simulator.time_ms(self._asked_ns)

    def getTrackerVersionString(self) -> str:  # noqa: N802
        """Return name and version."""
        return VERSION

    def getCalibrationResult(self) -> int:  # noqa: N802
        """Return 0 when the last calibration was good, 1000 before any and while one runs."""
        return self._library.simulator.target(self._library.clock.now_ns())[3]

    def getCalibrationMessage(self) -> str:  # noqa: N802
        """Return the host's words on it."""
        return self._library.simulator.verdict_text

    def sendMessage(self, text: str) -> int:  # noqa: N802
        """Store a message in the open file; without one it is lost."""
        if self._open is not None:
            self._library.files[self._open].append(text)
        return 0

    def close(self) -> None:
        """Disconnect."""
        self.recording = False


class FakeSample:
    """One sample with pylink's accessors."""

    def __init__(self, raw: bytes) -> None:
        self._time_ms, self._eyes, *self._numbers = SAMPLE.unpack(raw)

    def getTime(self) -> float:  # noqa: N802
        """Return the tracker's milliseconds."""
        return float(self._time_ms)

    def isLeftSample(self) -> bool:  # noqa: N802
        """Tell whether only the left eye is tracked."""
        return bool(self._eyes == 1)

    def isRightSample(self) -> bool:  # noqa: N802
        """Tell whether only the right eye is tracked."""
        return bool(self._eyes == 2)

    def isBinocular(self) -> bool:  # noqa: N802
        """Tell whether both are."""
        return bool(self._eyes == 3)

    def getLeftEye(self) -> "FakeEye":  # noqa: N802
        """Return the left eye."""
        return FakeEye(self._numbers[:3])

    def getRightEye(self) -> "FakeEye":  # noqa: N802
        """Return the right eye."""
        return FakeEye(self._numbers[3:])


class FakeEye:
    """One eye of a sample."""

    def __init__(self, numbers: list[Any]) -> None:
        self._numbers = numbers

    def getGaze(self) -> tuple[float, float]:  # noqa: N802
        """Return pixels."""
        return self._numbers[0], self._numbers[1]

    def getPupilSize(self) -> float:  # noqa: N802
        """Return the tracker's units."""
        return float(self._numbers[2])

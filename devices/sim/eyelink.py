"""An EyeLink in memory.

The link's protocol is private, so nothing below pylink's surface is modelled; nor are events, the
camera's picture and EDF files. A calibration shows nine targets for 1 s each and accepts them by
itself; its verdict is the `verdict` that was given.
"""

import struct
from typing import Unpack

from visavis.devices.contracts import Body
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_MS

SAMPLE = struct.Struct("<dB6d")
TARGET = struct.Struct("<4i")
TARGET_NS, HIDDEN_NS = 1000 * NS_PER_MS, 100 * NS_PER_MS
TARGETS = ((0, 0), (0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (1, -1), (-1, 1), (1, 1))
"""Right and down from the screen's middle, in shares of what is calibrated."""
MISSING = -32768.0
OK_RESULT, NO_REPLY = 0, 1000
DIAMETER_UNITS_PER_MM = 1000.0
AREA_UNITS_PER_MM2 = 160.0
VERSION = "EYELINK CL 5.15"


class EyeLinkSimulator(GazePeer):
    """Send link samples of a body that looks at a screen; `verdict` is the host's code.

    `display_px` is the display size that was sent to the host. On a memory wire no library sends
    it, so it is that of the options; so is `gives_area`, what a pupil's size means.
    """

    driver = "eyelink"
    usual_rate_hz = 1000.0
    usual_epoch_ns = 3_600_000 * NS_PER_MS
    is_calibrated_before = True

    def __init__(
        self,
        body: Body,
        *,
        screen: Screen | None = None,
        screen_px: tuple[int, int] = (1920, 1080),
        verdict: int = OK_RESULT,
        gives_area: bool = False,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.messages: list[str] = []
        self.verdict = verdict
        self._setup_ns: int | None = None
        self._target = (0, 0)
        self.drift_px: list[tuple[int, int]] = []
        self.drift_code = 0
        self.gives_area = gives_area
        self._screen = screen or Screen()
        self.display_px = screen_px

    @property
    def is_busy(self) -> bool:
        """Tell whether the host is in its camera setup."""
        return self._setup_ns is not None

    def to_message(self, shot: Shot) -> Frames | None:
        """Return one link sample; none while the host calibrates."""
        if self._setup_ns is not None:
            return None
        return (self.pack(shot) if shot.garbage is None else shot.garbage,)

    def pack(self, shot: Shot) -> bytes:
        """Return a sample: time in whole (at 2000 Hz half) milliseconds, pixels, pupil units."""
        step_ns = NS_PER_MS if self.source.rate_hz <= 1000 else NS_PER_MS // 2
        time_ms = shot.t_device_ns // step_ns * step_ns / NS_PER_MS
        numbers: list[float] = []
        for x_m, ray, is_seen in (
            (-EYE_X_M, shot.left, shot.left_seen),
            (EYE_X_M, shot.right, shot.right_seen),
        ):
            x, y = self._screen.shares_of((x_m, 0.0, 0.0), ray)
            if is_seen and x == x:
                pupil = self.pupil_units(shot.pupil_mm)
                numbers += [x * self.display_px[0], y * self.display_px[1], pupil]
            else:
                numbers += [MISSING, MISSING, 0.0]
        return SAMPLE.pack(time_ms, 3, *numbers)

    def pupil_units(self, pupil_mm: float) -> float:
        """Return a pupil's size as the host gives it: diameter or area, each in its own unit."""
        area = AREA_UNITS_PER_MM2 * pupil_mm**2
        return area if self.gives_area else DIAMETER_UNITS_PER_MM * pupil_mm

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as the library's functions return."""
        kind = frames[0]
        if kind == b"time":
            half = NS_PER_MS // 2
            return kind, struct.pack("<q", self.time_ms(t_ns) * NS_PER_MS + half)
        if kind == b"version":
            return kind, self.source.claimed_version(t_ns, VERSION).encode()
        if kind == b"verdict":
            return kind, struct.pack("<i", self.verdict) + self.verdict_text.encode()
        if kind == b"record":
            return kind, b""
        if kind == b"setup":
            self.begin_setup(t_ns)
            return kind, b""
        if kind == b"target":
            return kind, TARGET.pack(*self.target(t_ns))
        if kind == b"leave":
            self.leave_setup(t_ns)
            return kind, b""
        if kind == b"drift":
            x, y = map(int, frames[1].split())
            self.drift_px.append((x, y))
            return kind, struct.pack("<i", self.drift_code)
        self.messages.append(kind.decode())
        return None

    def time_ms(self, t_ns: int) -> int:
        """Return the host's clock in whole milliseconds."""
        return self.source.device_ns(t_ns) // NS_PER_MS

    def begin_setup(self, t_ns: int) -> None:
        """Begin a calibration: recording has ended."""
        self.advance(t_ns)
        self._setup_ns = t_ns

    def target(self, t_ns: int) -> tuple[int, int, int, int]:
        """Return whether a target is shown, its place, and the result of the calibration."""
        if self._setup_ns is None:
            return 0, *self._target, self.verdict
        number, into_ns = divmod(t_ns - self._setup_ns, TARGET_NS)
        if number >= len(TARGETS):
            return 0, *self._target, self.verdict
        width, height = self.display_px
        right, down = TARGETS[number]
        self._target = round(width * (0.5 + 0.35 * right)), round(height * (0.5 + 0.35 * down))
        return int(into_ns >= HIDDEN_NS), *self._target, NO_REPLY

    def leave_setup(self, t_ns: int) -> None:
        """Record again; a good result is in force."""
        self.advance(t_ns)
        if self._setup_ns is not None and self.verdict == OK_RESULT:
            self.source.calibrated_fit = self.source.body.fit()
        self._setup_ns = None

    @property
    def verdict_text(self) -> str:
        """The host's words on its last calibration."""
        return "calibration result: GOOD" if self.verdict == OK_RESULT else ""

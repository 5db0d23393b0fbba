"""An EyeLink in memory.

The link's protocol is private, so nothing below pylink's surface is modelled; nor are events,
camera setup, drift checks and EDF files.
"""

import struct
from typing import Unpack

from visavis.devices.contracts import Body
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_MS

SAMPLE = struct.Struct("<dB6d")
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
        self.gives_area = gives_area
        self._screen = screen or Screen()
        self.display_px = screen_px

    def to_message(self, shot: Shot) -> Frames:
        """Return one link sample."""
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
        self.messages.append(kind.decode())
        return None

    def time_ms(self, t_ns: int) -> int:
        """Return the host's clock in whole milliseconds."""
        return self.source.device_ns(t_ns) // NS_PER_MS

    @property
    def verdict_text(self) -> str:
        """The host's words on its last calibration."""
        return "calibration result: GOOD" if self.verdict == OK_RESULT else ""

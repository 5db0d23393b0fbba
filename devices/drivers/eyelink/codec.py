"""Turn EyeLink link samples into canonical gaze; pure.

Sources: SR Research's public pylink interface and its users. Gaze is in display pixels from the
top left, times in milliseconds of the tracker, pupils in its own units. -32768 (also 32767) marks
missing numbers, and 4294967295 a time that is not known.
"""

import struct

from visavis.devices.contracts import SessionName
from visavis.devices.drivers.eyelink.spec import PupilScale
from visavis.devices.drivers.streaming.gaze_rays import (
    NO_VECTOR,
    Eye,
    Sample,
    diameter_mm,
    gaze_row,
    ray_between,
)
from visavis.devices.drivers.streaming.screen import NAN, Screen, Triple

SAMPLE = struct.Struct("<dB6d")
"""Time (ms), eyes present (1 left, 2 right), then x, y (px) and pupil of left and right."""

LEFT, RIGHT = 1, 2
MISSING_BEYOND = 32_767.0
NO_TIME = 4_294_967_295
MAX_MESSAGE = 130
MAX_EDF_NAME = 8


UNKNOWN_PUPIL = PupilScale()

TARGET = struct.Struct("<4i")
"""Whether the host shows a target, its place (px), and the result of the calibration."""
NO_REPLY = 1000
"""Result as long as there is none."""
DRIFT_RESULTS = {
    0: "gaze was shifted onto the target",
    1: "the host could not compute it: calibrate again",
    2: "the host had too little of a fixation",
    3: "gaze was further off than the host corrects",
    NO_REPLY: "the host did not answer",
}
"""What the host says to `online_dcorr_trigger`, by the vendor's list of commands."""


def pupil_sizes(raw: bytes) -> tuple[float, ...]:
    """Return the pupils' sizes in a whole sample, in the tracker's unit, of the eyes it has."""
    _, eyes, *numbers = SAMPLE.unpack(raw)
    return tuple(numbers[i] for bit, i in ((LEFT, 2), (RIGHT, 5)) if eyes & bit and numbers[i] > 0)


def decode_sample(
    raw: bytes,
    screen: Screen,
    screen_px: tuple[int, int],
    half_m: float,
    pupil_scale: PupilScale = UNKNOWN_PUPIL,
) -> Sample | None:
    """Return the sample; None when it is malformed or its time is not known."""
    if len(raw) != SAMPLE.size:
        return None
    time_ms, eyes, *numbers = SAMPLE.unpack(raw)
    if not 0 <= time_ms < NO_TIME:
        return None
    rows = []
    for bit, x_m, (x, y, pupil) in (
        (LEFT, -half_m, numbers[:3]),
        (RIGHT, half_m, numbers[3:]),
    ):
        at = (x_m, 0.0, 0.0)
        has_gaze = bool(eyes & bit) and abs(x) < MISSING_BEYOND and abs(y) < MISSING_BEYOND
        point = screen.point_m(x / screen_px[0], y / screen_px[1]) if has_gaze else NO_VECTOR
        ray = ray_between(at, point)
        size = diameter_mm(pupil_scale.diameter_mm(pupil)) if has_gaze else NAN
        rows.append(Eye(ray, at, ray[0] == ray[0], size))
    return Sample(round(time_ms * 1e6), None, gaze_row(rows[0], rows[1]))


def target_px(point_m: Triple, screen: Screen, screen_px: tuple[int, int]) -> tuple[int, int]:
    """Return the pixel in which a direction from between the eyes meets the screen."""
    x, y = screen.shares_of((0.0, 0.0, 0.0), point_m)
    return round(x * screen_px[0]), round(y * screen_px[1])


def screen_coordinates(screen_px: tuple[int, int]) -> str:
    """Return the corners of the display, as the tracker takes them: the first and last pixels."""
    return f"0 0 {screen_px[0] - 1} {screen_px[1] - 1}"


def edf_name(session: SessionName) -> str:
    """Return the name of a session's file on the host computer, "S0011_02" for S001's part 2.

    The host takes at most eight capitals, digits and underscores: a long label keeps its end.
    """
    rest = f"{session.session}_{session.part:02d}"
    label = "".join(c for c in session.participant.upper() if c.isascii() and c.isalnum())
    return label[-max(1, MAX_EDF_NAME - len(rest)) :] + rest


def delayed_message(text: str, late_ns: int) -> str:
    """Return a marker that begins with its delay in whole milliseconds.

    The vendor's Data Viewer subtracts a leading integer from the time of the message.
    """
    return f"{round(max(0, late_ns) / 1e6)} {text}"


def message_text(text: str) -> str:
    """Return a marker as the tracker takes it: one short line of ASCII."""
    line = " ".join(text.split()).encode("ascii", "replace").decode()
    return line[:MAX_MESSAGE]

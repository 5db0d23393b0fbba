"""The 38 gestures by name, each as where a hand is at the start and the end of its stroke.

The source counts 38 lexemes and prints the names of two (cup, frame); the others are ours, chosen
so that they cover pointing, emblems, beats, and pictures of size, way and comparison.
"""

from dataclasses import dataclass
from typing import Final

Triple = tuple[float, float, float]
AHEAD, BACK = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
UP, DOWN = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
IN, OUT = (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)
RISING, INTO = (0.15, 0.45, -0.85), (0.55, 0.10, -0.80)

SHAPES: Final[dict[str, tuple[float, float, float, float, float, float, float]]] = {
    "open": (0.10, 0.11, 0.13, 0.16, 0.10, 0.10, 10.0),
    "flat": (0.02, 0.02, 0.02, 0.03, 0.15, 0.20, 0.0),
    "loose": (0.24, 0.29, 0.34, 0.40, 0.25, 0.25, 5.0),
    "cup": (0.26, 0.29, 0.32, 0.35, 0.15, 0.45, 6.0),
    "point": (0.02, 0.78, 0.84, 0.88, 0.60, 0.55, 0.0),
    "two": (0.02, 0.03, 0.85, 0.88, 0.65, 0.60, 12.0),
    "fist": (0.92, 0.94, 0.94, 0.94, 0.60, 0.60, 0.0),
    "thumb": (0.92, 0.94, 0.94, 0.94, 0.00, 0.00, 0.0),
    "ring": (0.52, 0.16, 0.20, 0.26, 0.50, 0.80, 8.0),
    "pinch": (0.46, 0.70, 0.76, 0.80, 0.45, 0.70, 0.0),
}
"""Hands: curl of index, middle, ring and little finger, bend and opposition (rad) of the thumb,
spread (degrees).
"""


@dataclass(frozen=True)
class Lexeme:
    """A gesture of one hand, written for the left; the right one is its mirror image.

    `start` and `end` are where the wrist is as the stroke begins and ends: from the middle of the
    shoulders, in arm's lengths (x to the right: −.33 is before the own shoulder; y up; −z ahead).
    Fingers and palm point along `fingers`, `palm`, at the end along `fingers_end`, `palm_end` (as
    at the start where they are None). `bow` is how far the way between them bends; `shake` swings
    `shakes` times about it. `shoulder_deg` lifts the shoulder; of `alternates`, the right hand
    goes the other way when both take part.
    """

    start: Triple
    end: Triple
    fingers: Triple
    palm: Triple
    shape: str = "open"
    fingers_end: Triple | None = None
    palm_end: Triple | None = None
    bow: Triple = (0.0, 0.0, 0.0)
    shake: Triple = (0.0, 0.0, 0.0)
    shakes: float = 0.0
    shoulder_deg: float = 0.0
    alternates: bool = False


LEXEMES: Final[dict[str, Lexeme]] = {
    # Offering and presenting.
    "cup": Lexeme((-0.30, -0.42, -0.50), (-0.34, -0.50, -0.62), RISING, UP, "cup"),
    "cup_flip": Lexeme((-0.26, -0.36, -0.52), (-0.42, -0.46, -0.60), INTO, IN, "cup", AHEAD, UP),
    "offer": Lexeme((-0.22, -0.55, -0.44), (-0.32, -0.42, -0.70), AHEAD, UP, "flat"),
    "open_arms": Lexeme(
        (-0.22, -0.42, -0.52), (-0.80, -0.34, -0.44), AHEAD, IN, "open", (-0.45, 0.35, -0.8), UP
    ),
    "shrug": Lexeme(
        (-0.36, -0.52, -0.44), (-0.58, -0.40, -0.42), AHEAD, UP, "open", (-0.5, 0.3, -0.8),
        shoulder_deg=9.0,
    ),
    "weigh": Lexeme(
        (-0.34, -0.58, -0.56), (-0.36, -0.34, -0.56), RISING, UP, "cup", alternates=True
    ),
    # Size, place and shape.
    "frame": Lexeme((-0.30, -0.34, -0.54), (-0.30, -0.46, -0.58), AHEAD, IN, "open"),
    "walls": Lexeme((-0.24, -0.30, -0.58), (-0.46, -0.30, -0.60), (0.0, 0.8, -0.6), IN, "flat"),
    "apart": Lexeme((-0.14, -0.40, -0.58), (-0.66, -0.38, -0.54), AHEAD, IN, "open"),
    "together": Lexeme((-0.64, -0.38, -0.54), (-0.17, -0.42, -0.58), AHEAD, IN, "open"),
    "gather": Lexeme(
        (-0.72, -0.36, -0.50), (-0.22, -0.44, -0.50), (-0.3, 0.2, -0.9), IN, "cup", INTO,
        (0.5, 0.6, 0.4), bow=(0.0, -0.08, -0.12),
    ),
    "arc": Lexeme(
        (-0.16, -0.42, -0.58), (-0.62, -0.42, -0.56), (0.2, 0.5, -0.85), DOWN, "open",
        (-0.3, 0.3, -0.9), bow=(0.0, 0.18, 0.0),
    ),
    "small": Lexeme((-0.28, -0.20, -0.54), (-0.28, -0.24, -0.62), (0.2, 0.7, -0.7), IN, "pinch"),
    "rise": Lexeme((-0.36, -0.60, -0.56), (-0.36, -0.16, -0.60), AHEAD, UP, "flat"),
    "sink": Lexeme((-0.36, -0.22, -0.58), (-0.36, -0.60, -0.58), AHEAD, DOWN, "flat"),
    # Ways and processes.
    "progressive": Lexeme(
        (-0.32, -0.40, -0.46), (-0.32, -0.42, -0.66), (0.35, 0.3, -0.9), BACK, "loose",
        AHEAD, IN, (0.0, 0.14, 0.0),
    ),
    "push": Lexeme(
        (-0.32, -0.28, -0.44), (-0.34, -0.28, -0.76), (0.0, 0.9, -0.35), AHEAD, "flat"
    ),
    "pull": Lexeme(
        (-0.34, -0.28, -0.74), (-0.30, -0.40, -0.42), (0.1, 0.5, -0.9), UP, "loose",
        palm_end=(0.3, 0.6, 0.8),
    ),
    "fling": Lexeme(
        (-0.40, -0.04, -0.42), (-0.42, -0.56, -0.66), (0.1, 0.9, -0.2), (0.3, 0.0, -0.9), "loose",
        AHEAD, DOWN, (0.0, 0.0, -0.12),
    ),
    "wipe": Lexeme((-0.12, -0.48, -0.58), (-0.66, -0.50, -0.56), INTO, DOWN, "flat", AHEAD),
    "slice": Lexeme((-0.66, -0.38, -0.54), (-0.18, -0.46, -0.56), AHEAD, DOWN, "flat", INTO),
    "chop": Lexeme(
        (-0.32, -0.18, -0.52), (-0.32, -0.52, -0.62), (0.1, 0.6, -0.8), IN, "flat", AHEAD
    ),
    "toss": Lexeme(
        (-0.30, -0.46, -0.48), (-0.52, -0.24, -0.56), INTO, BACK, "loose", (-0.4, 0.6, -0.7),
        (0.2, 0.8, 0.4), (0.0, -0.05, -0.06),
    ),
    # Pointing.
    "point_you": Lexeme((-0.34, -0.24, -0.46), (-0.32, -0.22, -0.82), RISING, IN, "point", AHEAD),
    "point_self": Lexeme(
        (-0.30, -0.34, -0.52), (-0.22, -0.31, -0.47), (0.75, 0.35, -0.4), BACK, "loose",
        (0.85, 0.25, 0.10),
    ),
    "point_side": Lexeme(
        (-0.44, -0.30, -0.44), (-0.86, -0.20, -0.38), (-0.4, 0.3, -0.85), (0.3, 0.0, -0.9),
        "point", (-0.95, 0.1, -0.3),
    ),
    "point_up": Lexeme(
        (-0.42, -0.22, -0.46), (-0.42, 0.16, -0.46), (0.0, 0.8, -0.6), IN, "point",
        (0.0, 1.0, -0.15),
    ),
    "point_down": Lexeme(
        (-0.36, -0.30, -0.56), (-0.36, -0.46, -0.62), AHEAD, DOWN, "point", (0.0, -0.8, -0.6)
    ),
    "attention": Lexeme(
        (-0.40, -0.24, -0.50), (-0.40, -0.06, -0.52), (0.0, 0.9, -0.4), (0.3, 0.0, -0.95), "point",
        UP,
    ),
    # Emblems.
    "stop": Lexeme((-0.32, -0.30, -0.42), (-0.34, -0.14, -0.64), (0.0, 0.9, -0.4), AHEAD, "flat"),
    "calm": Lexeme(
        (-0.34, -0.36, -0.60), (-0.34, -0.48, -0.60), AHEAD, DOWN, "open",
        shake=(0.0, 0.035, 0.0), shakes=1.0,
    ),
    "dismiss": Lexeme(
        (-0.30, -0.22, -0.46), (-0.52, -0.28, -0.62), (0.3, 0.8, -0.4), BACK, "loose",
        (-0.3, 0.1, -0.95), DOWN,
    ),
    "thumb_up": Lexeme((-0.32, -0.40, -0.50), (-0.34, -0.30, -0.62), AHEAD, IN, "thumb"),
    "so_so": Lexeme(
        (-0.34, -0.36, -0.58), (-0.36, -0.36, -0.60), AHEAD, (0.5, -0.85, 0.0), "open",
        palm_end=(-0.35, -0.9, 0.0), shake=(0.02, 0.0, 0.0), shakes=2.0,
    ),
    "fist": Lexeme((-0.36, -0.14, -0.46), (-0.36, -0.30, -0.56), (0.0, 0.9, -0.4), IN, "fist"),
    # Beats and precision.
    "beat": Lexeme((-0.32, -0.40, -0.54), (-0.32, -0.52, -0.58), RISING, (0.8, -0.5, 0.0), "loose"),
    "ring": Lexeme(
        (-0.34, -0.20, -0.52), (-0.34, -0.32, -0.60), (0.1, 0.75, -0.65), (0.5, 0.0, -0.85), "ring"
    ),
    "count": Lexeme(
        (-0.36, -0.28, -0.48), (-0.36, -0.16, -0.54), (0.1, 0.9, -0.4), (0.4, 0.0, 0.9), "two"
    ),
}  # fmt: skip

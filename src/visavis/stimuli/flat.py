"""Flat stimuli as data: texts, pictures, shapes, gratings, dots and films, in degrees of visual
angle; and the panorama that may stand around them.

What they look like is `visavis.stimuli.flat_pixels`'s, how dots move `visavis.stimuli.dots`'s;
where they stand before somebody is `visavis.stimuli.scenes.flat`'s.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, get_args

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.lab.yaml_lines import did_you_mean

COLOURS: Final = {
    "black": (0, 0, 0),
    "white": (255, 255, 255),
    "grey": (128, 128, 128),
    "gray": (128, 128, 128),
    "red": (255, 0, 0),
    "green": (0, 160, 0),
    "blue": (0, 80, 255),
    "yellow": (255, 220, 0),
    "cyan": (0, 200, 220),
    "magenta": (230, 0, 200),
    "orange": (255, 140, 0),
    "purple": (140, 40, 200),
    "brown": (140, 80, 30),
    "pink": (255, 150, 190),
}
"""Colours by name, sRGB."""
Colour: TypeAlias = str | tuple[int, int, int]
Kind: TypeAlias = Literal["rectangle", "ellipse", "cross", "triangle"]
Mask: TypeAlias = Literal["gauss", "circle", "none"]
Noise: TypeAlias = Literal["direction", "position"]
Aperture: TypeAlias = Literal["circle", "square"]
Stereo: TypeAlias = Literal["none", "top-bottom", "left-right"]
MAX_DEG: Final = 150.0
LEVELS: Final = 255
MAX_DOTS: Final = 5000
"""More are not placed and drawn within a frame."""
MAX_STEPS_HZ: Final = 500.0
MAX_SEED: Final = 2**32
FILM_ENDINGS: Final = (
    ".mp4",
    ".m4v",
    ".mov",
    ".webm",
    ".mkv",
    ".avi",
    ".mpg",
    ".mpeg",
    ".ts",
    ".mts",
    ".m2ts",
    ".ogv",
    ".wmv",
    ".flv",
    ".3gp",
)
"""By these a file all around is a film, by others a picture."""


def rgb_of(colour: Colour) -> tuple[int, int, int]:
    """Return a colour as sRGB: a name, "#rrggbb", or three whole numbers from 0 to 255.

    Raises:
        DesignError: it is none of these.
    """
    if isinstance(colour, str):
        if colour in COLOURS:
            return COLOURS[colour]
        try:
            if len(colour) == len("#rrggbb") and colour[0] == "#":
                red, green, blue = bytes.fromhex(colour[1:])
                return red, green, blue
        except ValueError:
            pass
        raise DesignError(
            f"there is no colour {colour!r}{did_you_mean(colour, COLOURS)}; "
            'it may be "#rrggbb" or three numbers from 0 to 255, too'
        )
    numbers = tuple(colour) if isinstance(colour, tuple | list) else ()
    if len(numbers) != 3 or any(not isinstance(n, int) or not 0 <= n <= LEVELS for n in numbers):
        raise DesignError(f"the colour {colour!r} is not three whole numbers from 0 to 255")
    return numbers


def _write_plain_numbers(flat: Any) -> None:
    """Make numbers of numpy plain ones: recorded events hold them as they are written."""
    for one in fields(flat):
        value = getattr(flat, one.name)
        if hasattr(value, "item"):
            object.__setattr__(flat, one.name, value.item())


def _require_size(what: str, **sizes_deg: float) -> None:
    for name, deg in sizes_deg.items():
        if not 0.0 < deg <= MAX_DEG:
            raise DesignError(f"{what}: {name} is {deg:g}; from 0 to {MAX_DEG:g} degrees")


def _require_angle(what: str, **angles_deg: float) -> None:
    for name, deg in angles_deg.items():
        if not math.isfinite(deg):
            raise DesignError(f"{what}: {name} is {deg:g}; give degrees")


def _require_place(what: str, at_deg: tuple[float, float]) -> tuple[float, float]:
    if len(at_deg) != 2 or not all(math.isfinite(v) and abs(v) < 90.0 for v in at_deg):
        raise DesignError(f"{what}: at_deg is {at_deg!r}; degrees to the right and upwards")
    return float(at_deg[0]), float(at_deg[1])


@dataclass(frozen=True)
@of_kinds(text=str | int | float | bool)
class Text:
    """Words in one or more lines; `height_deg` is the height of a line's letters from the top of
    an h to the bottom of a g, `at_deg` their middle, right of and above what is straight ahead.
    """

    text: str
    colour: Colour = "white"
    height_deg: float = 1.0
    at_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        if not str(self.text).strip():
            raise DesignError("Text: there is nothing to read; give at least one letter")
        object.__setattr__(self, "text", str(self.text))
        _require_size(f"Text {self.text!r}", height_deg=self.height_deg)
        object.__setattr__(self, "at_deg", _require_place("Text", self.at_deg))
        rgb_of(self.colour)


@dataclass(frozen=True)
@of_kinds(file=str | Path, areas=str | Path)
class Image:
    """A picture of a file beside the study's (PNG, JPEG, …), `width_deg` wide or `height_deg` high;
    the other follows from its pixels. `areas` names a file of areas of interest in its pixels.
    """

    file: str
    width_deg: float | None = None
    height_deg: float | None = None
    at_deg: tuple[float, float] = (0.0, 0.0)
    areas: str = ""

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        object.__setattr__(self, "file", str(self.file))
        object.__setattr__(self, "areas", str(self.areas))
        sizes = {n: getattr(self, n) for n in ("width_deg", "height_deg")}
        sizes_deg = {name: deg for name, deg in sizes.items() if deg is not None}
        if not sizes_deg:
            raise DesignError(f"Image {self.file!r}: say its width_deg or its height_deg")
        _require_size(f"Image {self.file!r}", **sizes_deg)
        object.__setattr__(self, "at_deg", _require_place("Image", self.at_deg))


@dataclass(frozen=True)
@of_kinds()
class Shape:
    """A rectangle, ellipse, cross or triangle, `width_deg` by `height_deg` (left out: as wide);
    filled or, with `line_deg`, an outline of that width (a cross: its bars).
    """

    kind: Kind
    width_deg: float = 1.0
    height_deg: float | None = None
    colour: Colour = "white"
    line_deg: float = 0.0
    at_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        high = self.width_deg if self.height_deg is None else self.height_deg
        _require_size(f"Shape {self.kind}", width_deg=self.width_deg, height_deg=high)
        object.__setattr__(self, "height_deg", float(high))
        if not 0.0 <= self.line_deg <= min(self.width_deg, high):
            raise DesignError(f"Shape {self.kind}: line_deg is {self.line_deg:g}; 0 fills it")
        object.__setattr__(self, "at_deg", _require_place("Shape", self.at_deg))
        rgb_of(self.colour)


@dataclass(frozen=True)
@of_kinds()
class Grating:
    """A sinusoidal grating around the middle grey (128) it stands on; with a Gaussian `mask` a
    Gabor patch.

    `orientation_deg` 0 is vertical bars, and turns counter-clockwise; `phase_deg` 0 is brightest in
    the middle. `contrast_01` is Michelson's: of light before a monitor whose luminances were
    measured, else of sRGB values. `sd_deg` is the mask's standard deviation (left out: a sixth of
    the width).
    """

    width_deg: float = 4.0
    cycles_per_deg: float = 2.0
    contrast_01: float = 1.0
    orientation_deg: float = 0.0
    phase_deg: float = 0.0
    mask: Mask = "gauss"
    sd_deg: float | None = None
    at_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        _require_size("Grating", width_deg=self.width_deg)
        if not self.cycles_per_deg > 0.0:
            raise DesignError(f"Grating: cycles_per_deg is {self.cycles_per_deg:g}; above 0")
        if not 0.0 <= self.contrast_01 <= 1.0:
            raise DesignError(f"Grating: contrast_01 is {self.contrast_01:g}; from 0 to 1")
        angles_deg = {n: getattr(self, n) for n in ("orientation_deg", "phase_deg")}
        _require_angle("Grating", **angles_deg)
        sd_deg = self.width_deg / 6 if self.sd_deg is None else self.sd_deg
        _require_size("Grating", sd_deg=sd_deg)
        object.__setattr__(self, "sd_deg", float(sd_deg))
        object.__setattr__(self, "at_deg", _require_place("Grating", self.at_deg))


@dataclass(frozen=True)
@of_kinds()
class Dots:
    """Random dots in a field `width_deg` wide, of which the share `coherence_01` moves in one
    direction (0 to the right, 90 upwards), at `speed_deg_per_s`, `rate_hz` times a second.

    The other dots move each in a direction of its own at the same speed (`noise="direction"`) or
    are somewhere else each time (`"position"`). After `lifetime_s` (left out: never) a dot
    begins anew elsewhere. A dot that leaves the field comes in on the other side. `seed` settles
    every place at every time; without one `t.show` gives each trial its own.
    """

    coherence_01: float = 0.5
    direction_deg: float = 0.0
    speed_deg_per_s: float = 5.0
    width_deg: float = 8.0
    density_per_deg2: float = 2.0
    dot_deg: float = 0.12
    lifetime_s: float | None = None
    noise: Noise = "direction"
    aperture: Aperture = "circle"
    colour: Colour = "white"
    seed: int | None = None
    rate_hz: float = 60.0
    at_deg: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        _require_size("Dots", width_deg=self.width_deg, dot_deg=self.dot_deg)
        if self.dot_deg >= self.width_deg:
            raise DesignError(
                f"Dots: dot_deg is {self.dot_deg:g}; smaller than the field, {self.width_deg:g}"
            )
        if not 0.0 <= self.coherence_01 <= 1.0:
            raise DesignError(f"Dots: coherence_01 is {self.coherence_01:g}; from 0 to 1")
        _require_angle("Dots", direction_deg=self.direction_deg)
        if not 0.0 < self.rate_hz <= MAX_STEPS_HZ:
            raise DesignError(f"Dots: rate_hz is {self.rate_hz:g}; up to {MAX_STEPS_HZ:g}")
        if not 0.0 <= self.speed_deg_per_s <= self.width_deg * self.rate_hz / 4:
            raise DesignError(
                f"Dots: speed_deg_per_s is {self.speed_deg_per_s:g}; from 0 to a quarter of the "
                f"field a step, {self.width_deg * self.rate_hz / 4:g}"
            )
        if self.lifetime_s is not None and not 0.0 < self.lifetime_s < math.inf:
            raise DesignError(f"Dots: lifetime_s is {self.lifetime_s:g}; above 0, or left out")
        if self.seed is not None and not 0 <= self.seed < MAX_SEED:
            raise DesignError(f"Dots: seed is {self.seed!r}; a whole number from 0, below 2**32")
        count = self.density_per_deg2 * self.width_deg**2
        if not 1.0 <= count <= MAX_DOTS:
            raise DesignError(
                f"Dots: {self.density_per_deg2:g} dots a square degree are {count:g} in a field "
                f"{self.width_deg:g} degrees wide; from 1 to {MAX_DOTS}"
            )
        object.__setattr__(self, "at_deg", _require_place("Dots", self.at_deg))
        rgb_of(self.colour)


@dataclass(frozen=True)
@of_kinds(file=str | Path, areas=str | Path)
class Video:
    """A film of a file beside the study's (MP4, WebM, …), `width_deg` wide or `height_deg` high;
    the other follows from its pixels. After its end its last picture stays.

    Its sound, if it has any, is heard with it unless `is_heard` is false, as loud as it was
    recorded or at `level_db`, as of a `Sound`. `areas` names a file of areas of interest, which may
    move by key frames.
    """

    file: str
    width_deg: float | None = None
    height_deg: float | None = None
    at_deg: tuple[float, float] = (0.0, 0.0)
    is_heard: bool = True
    level_db: float | None = None
    areas: str = ""

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        object.__setattr__(self, "file", str(self.file))
        object.__setattr__(self, "areas", str(self.areas))
        if not self.file:
            raise DesignError("Video: name its file, which lies beside the study's")
        sizes = {n: getattr(self, n) for n in ("width_deg", "height_deg")}
        sizes_deg = {name: deg for name, deg in sizes.items() if deg is not None}
        if not sizes_deg:
            raise DesignError(f"Video {self.file!r}: give width_deg or height_deg")
        _require_size(f"Video {self.file!r}", **sizes_deg)
        object.__setattr__(self, "at_deg", _require_place("Video", self.at_deg))


@dataclass(frozen=True)
@of_kinds(file=str | Path, areas=str | Path)
class Panorama:
    """A picture or film all around, 360 by 180 degrees (equirectangular), of a file beside the
    study's.

    With `stereo` each eye sees its half of it: the left eye the upper or the left one. `yaw_deg`
    says which part is straight ahead at the onset, to the right of the picture's middle. `areas`
    names a file of areas of interest, in degrees. Before a monitor arrow keys turn the view. A film
    is heard as a `Video` is, unless `is_heard` is false, and its areas may move.
    """

    file: str
    stereo: Stereo = "none"
    yaw_deg: float = 0.0
    areas: str = ""
    # Events describe panoramas as they did before there were films; what is heard they say apart.
    is_heard: bool = field(default=True, repr=False)
    level_db: float | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        _write_plain_numbers(self)
        object.__setattr__(self, "file", str(self.file))
        object.__setattr__(self, "areas", str(self.areas))
        if not -360.0 <= self.yaw_deg <= 360.0:
            raise DesignError(f"Panorama {self.file!r}: yaw_deg is {self.yaw_deg:g}; -360 to 360")
        if not self.is_film and (self.level_db is not None or not self.is_heard):
            raise DesignError(
                f"Panorama {self.file!r}: a picture is not heard; leave out is_heard and level_db"
            )

    @property
    def is_film(self) -> bool:
        """Whether its file is a film, by the file's ending."""
        return Path(self.file).suffix.lower() in FILM_ENDINGS


Flat: TypeAlias = Text | Image | Shape | Grating | Dots | Video
"""What stands flat before somebody."""
KINDS: Final[Mapping[str, type[Flat | Panorama]]] = {
    kind.__name__: kind for kind in (*get_args(Flat), Panorama)
}
"""The kinds of flat stimuli by name, and the panorama."""


def films_among(stimuli: Iterable[Flat | Panorama | None]) -> tuple[Video | Panorama, ...]:
    """Return the films of some stimuli, in their order."""
    return tuple(
        one
        for one in stimuli
        if isinstance(one, Video) or (isinstance(one, Panorama) and one.is_film)
    )


def is_round(flat: Flat) -> bool:
    """Tell whether a stimulus fills an ellipse, not its whole box."""
    match flat:
        case Shape():
            return flat.kind == "ellipse"
        case Grating():
            return flat.mask == "circle"
        case Dots():
            return flat.aperture == "circle"
    return False


def picture_path(image: Image | Video | Panorama, folder: Path) -> Path:
    """Return where the file of a picture or film lies."""
    return folder / image.file

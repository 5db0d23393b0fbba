"""The measured luminances of a screen: their table, a fit to it, and what grey to draw for a light.

A table is CSV with one row for each level that was shown full-field: `level` (0 to 255), `cd_m2`,
and, where they are given, `gun` ("grey" or one of the three guns) and `screen` (which one it was).
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import ConfigError, DataError
from visavis.lab.foreign_text import ForeignRows, decode_text, read_rows

Floats = npt.NDArray[np.float64]
GREY: Final = "grey"
GUNS: Final = ("red", "green", "blue")
LUMINANCE_KEY: Final = "luminance"
"""The entry of a manifest's configuration; without a hash nothing was measured."""
NO_LUMINANCES: Final = (
    "the screen's luminances were not measured: contrasts are of values, not of light (visavis "
    "devices luminance)"
)
WHITE: Final = 255
MIDDLE: Final = 128
"""The grey between black and white; its light is the middle of theirs."""
MIN_LEVELS: Final = 6
GAMMAS: Final = (0.3, 5.0)
FLOOR_01: Final = 0.01
"""Deviations are weighed by the luminance, but not by less than this share of the greatest."""


@dataclass(frozen=True)
class LuminanceFit:
    """The curve black + range · (level / 255)^gamma that is nearest to measured luminances.

    They lie beside it by `rms_cd_m2`, and by `largest_cd_m2` at `worst_level`.
    """

    gamma: float
    black_cd_m2: float
    range_cd_m2: float
    rms_cd_m2: float
    largest_cd_m2: float
    worst_level: int


@dataclass(frozen=True)
class LuminanceCurve:
    """The luminances (cd/m²) of levels from 0 to 255, both rising: of all guns alike, or of one."""

    gun: str
    levels: tuple[int, ...]
    cd_m2: tuple[float, ...]

    @cached_property
    def fit(self) -> LuminanceFit:
        """The nearest curve with a gamma, by least squares of deviations as shares."""
        level, light = np.array(self.levels) / WHITE, np.array(self.cd_m2)
        weight = 1.0 / np.maximum(light, FLOOR_01 * light[-1])

        def nearest(gamma: float) -> tuple[float, Floats]:
            power = np.stack([np.ones_like(level), level**gamma], axis=1)
            own, *_ = np.linalg.lstsq(power * weight[:, None], light * weight, rcond=None)
            return float((((power @ own - light) * weight) ** 2).sum()), own

        low, high = GAMMAS
        gamma = low
        while high - low > 1e-7:
            steps = np.linspace(low, high, 21).tolist()
            gamma = min(steps, key=lambda gamma: nearest(gamma)[0])
            reach = steps[1] - steps[0]
            low, high = gamma - reach, gamma + reach
        black, span = nearest(gamma)[1].tolist()
        off = np.abs(black + span * level**gamma - light)
        rms, worst = float(np.sqrt((off**2).mean())), int(off.argmax())
        return LuminanceFit(gamma, black, span, rms, float(off[worst]), self.levels[worst])

    def levels_of(self, share_01: npt.ArrayLike) -> Floats:
        """Return the levels whose luminances are shares of the way from black to white.

        Between measured levels the curve is a power with the fit's gamma.
        """
        shares = np.clip(np.asarray(share_01, np.float64), 0.0, 1.0)
        return np.interp(shares ** (1.0 / self.fit.gamma), self._roots, self.levels)

    def luminances_of(self, levels: npt.ArrayLike) -> Floats:
        """Return the luminances (cd/m²) of levels, measured or between measured ones."""
        share_01 = (
            np.interp(np.asarray(levels, np.float64), self.levels, self._roots) ** self.fit.gamma
        )
        luminances: Floats = self.cd_m2[0] + (self.cd_m2[-1] - self.cd_m2[0]) * share_01
        return luminances

    @cached_property
    def _roots(self) -> Floats:
        """Return measured luminances as shares, in a scale on which levels are nearly even."""
        light = np.array(self.cd_m2)
        roots: Floats = ((light - light[0]) / (light[-1] - light[0])) ** (1.0 / self.fit.gamma)
        return roots


@dataclass(frozen=True)
class LuminanceTable:
    """What was measured on a screen: luminances of greys, and perhaps of each gun.

    `sha256` is that of its file (hex), `screen` which screen it was.
    """

    screen: str
    curves: tuple[LuminanceCurve, ...]
    sha256: str

    @property
    def grey(self) -> LuminanceCurve:
        """The curve of greys."""
        return self.curves[0]

    @property
    def greatest_contrast_01(self) -> float:
        """Michelson's contrast of white and black."""
        black, white = self.grey.cd_m2[0], self.grey.cd_m2[-1]
        return (white - black) / (white + black)

    @property
    def least_contrast_01(self) -> float:
        """Michelson's contrast of the levels next to the middle grey; less is not shown."""
        middle = int(np.rint(self.grey.levels_of(0.5)))
        low, high = self.grey.luminances_of((middle - 1, middle + 1)).tolist()
        return float((high - low) / (high + low))

    @property
    def summary(self) -> str:
        """The table in a line."""
        black, white = self.grey.cd_m2[0], self.grey.cd_m2[-1]
        return (
            f"table {self.sha256[:12]}, {black:.3g} to {white:.4g} cd/m², gamma "
            f"{self.grey.fit.gamma:.2f}, contrasts from "
            f"{self.least_contrast_01:.3f} to {self.greatest_contrast_01:.3f}"
        )

    def rgb_of_shares(self, share_01: npt.ArrayLike) -> npt.NDArray[np.uint8]:
        """Return the bytes (…, 3) of greys whose light is a share of the way from black to white.

        Where the guns were measured each gives its own share, so that the colour stays that of
        white.
        """
        guns = self.curves[1:] or (self.grey,)
        levels = np.stack([gun.levels_of(share_01) for gun in guns], axis=-1)
        rgb = np.rint(levels).astype(np.uint8)
        return np.broadcast_to(rgb, (*rgb.shape[:-1], len(GUNS)))

    def swing_01(self, contrast_01: float) -> float:
        """Return which share of all light a Michelson's contrast takes; 1 where that is too little.

        With a black that is dark, not without light, they are not the same.
        """
        return min(1.0, contrast_01 / self.greatest_contrast_01)

    def rgb_of(self, rgb: tuple[int, int, int]) -> tuple[int, int, int]:
        """Return what to draw for a colour: of a grey its share of light, of others the same."""
        if len(set(rgb)) > 1:
            return rgb
        share_01 = np.interp(rgb[0], (0, MIDDLE, WHITE), (0.0, 0.5, 1.0))
        red, green, blue = self.rgb_of_shares(share_01).tolist()
        return red, green, blue

    @property
    def rows(self) -> list[tuple[str, int, float]]:
        """Gun, level and luminance of everything that was measured."""
        return [
            (curve.gun, level, cd_m2)
            for curve in self.curves
            for level, cd_m2 in zip(curve.levels, curve.cd_m2, strict=True)
        ]

    def as_entry(self) -> dict[str, Any]:
        """Return the table as a recording's manifest holds it."""
        return {
            "sha256": self.sha256,
            "screen": self.screen,
            "rows": [list(row) for row in self.rows],
        }


def table_of_entry(entry: Mapping[str, Any] | None) -> LuminanceTable | None:
    """Return the table of a manifest's entry; None where none was measured.

    Raises:
        ConfigError: it is no such table.
    """
    if entry is None or (isinstance(entry, Mapping) and not entry.get("sha256")):
        return None
    what = f"the manifest's entry configuration.{LUMINANCE_KEY}"
    try:
        rows = [(str(gun), int(level), float(cd_m2)) for gun, level, cd_m2 in entry["rows"]]
        screen, sha256 = str(entry["screen"]), str(entry["sha256"])
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(
            f"{what} is damaged ({type(error).__name__}: {error}); put the session's manifest.json "
            "back from a copy (visavis recover)"
        ) from error
    return luminance_table(rows, screen, sha256, what)


def read_luminance(path: Path, screen: str) -> LuminanceTable:
    """Read the table of a screen.

    Raises:
        ConfigError: it cannot be read or used, with every row that is wrong.
    """
    try:
        raw = path.read_bytes()
        text, remarks = decode_text(raw)
        table = read_rows(text.rstrip("\n") + "\n", what=str(path))
    except OSError as error:
        raise ConfigError(
            f"{path} cannot be read ({error.strerror}); give the table's path"
        ) from error
    except (ValueError, DataError) as error:
        raise ConfigError(f"no luminances can be read from {path}: {error}") from error
    problems = [*remarks, *table.remarks, *_wrong_columns(table)]
    if problems:
        raise ConfigError(_refusal(str(path), problems))
    rows, problems = [], []
    for line, cells in zip(table.lines, table.rows, strict=True):
        row = dict(zip(table.names, map(str.strip, cells), strict=True))
        problems += [f"row {line}: {what}" for what in _wrong_cells(row, table.delimiter, screen)]
        rows.append((row.get("gun") or GREY, row["level"], _point(row["cd_m2"], table.delimiter)))
    if problems:
        raise ConfigError(_refusal(str(path), problems))
    numbers = [(gun, int(level), float(cd_m2)) for gun, level, cd_m2 in rows]
    sha256 = hashlib.sha256(raw).hexdigest()
    return luminance_table(numbers, screen, sha256, str(path), table.lines)


def luminance_table(
    rows: Sequence[tuple[str, int, float]],
    screen: str,
    sha256: str,
    what: str = "luminances",
    lines: Sequence[int] = (),
) -> LuminanceTable:
    """Return a table of rows of gun, level and luminance in any order; `lines` number the rows.

    Raises:
        ConfigError: there are too few, or they do not rise.
    """
    rows_by_level = sorted(zip(rows, lines or range(1, len(rows) + 1), strict=True))
    problems, curves = [], []
    guns = [gun for gun in (GREY, *GUNS) if any(gun == row[0] for row in rows)]
    if guns not in ([GREY], [GREY, *GUNS]):
        there = ", ".join(guns) or "nothing"
        problems.append(f"{there} is measured; measure grey, and all three guns or none")
    for gun in guns:
        own = [(level, cd_m2, line) for (of, level, cd_m2), line in rows_by_level if of == gun]
        levels = [level for level, _, _ in own]
        if len(set(levels)) < MIN_LEVELS or levels[0] != 0 or levels[-1] != WHITE:
            listing = ", ".join(map(str, levels))
            problems.append(
                f"{gun} has the levels {listing}; measure {MIN_LEVELS} or more, 0 and {WHITE} "
                "among them"
            )
        for (level, cd_m2, line), (next_level, next_cd_m2, next_line) in pairwise(own):
            if level == next_level:
                problems.append(f"row {next_line}: {gun} {level} stands in row {line} already")
            elif next_cd_m2 <= cd_m2:
                problems.append(
                    f"row {next_line}: {gun} {next_level} has {next_cd_m2:g} cd/m², not more than "
                    f"{cd_m2:g} of {level} in row {line}; measure both again"
                )
        curves.append(LuminanceCurve(gun, tuple(levels), tuple(c for _, c, _ in own)))
    if problems:
        raise ConfigError(_refusal(what, problems))
    return LuminanceTable(screen, tuple(curves), sha256)


def _refusal(what: str, problems: Sequence[str]) -> str:
    return f"{what} cannot be used: {'; '.join(problems)}"


def _point(number: str, delimiter: str) -> str:
    """Return a number with a decimal point; commas are decimal where they part no columns."""
    return number if delimiter == "," else number.replace(",", ".")


def _wrong_columns(table: ForeignRows) -> list[str]:
    missing = {"level", "cd_m2"} - set(table.names)
    others = [n for n in table.names if n not in ("level", "cd_m2", "gun", "screen")]
    if missing == {"cd_m2"} and others:
        return [
            f"row 1: the column {others[0]!r} names no unit; give luminances in cd/m² and call it "
            "cd_m2 (1 foot-lambert is 3.426 cd/m²)"
        ]
    return [f"row 1: there is no column {name!r}; give level and cd_m2" for name in sorted(missing)]


def _wrong_cells(row: Mapping[str, str], delimiter: str, screen: str) -> list[str]:
    problems = []
    if not (row["level"].isdecimal() and int(row["level"]) <= WHITE):
        problems.append(f"the level is {row['level']!r}; a whole number from 0 to {WHITE}")
    try:
        cd_m2 = float(_point(row["cd_m2"], delimiter))
    except ValueError:
        cd_m2 = math.nan
    if not 0.0 <= cd_m2 < math.inf:
        problems.append(f"cd_m2 is {row['cd_m2']!r}; a number from 0, without its unit")
    if (gun := row.get("gun") or GREY) not in (GREY, *GUNS):
        problems.append(f"there is no gun {gun!r}; {GREY}, {', '.join(GUNS)}")
    if (of := row.get("screen") or screen) != screen:
        problems.append(
            f"this was measured on another screen, {of}; the configuration's is {screen}: measure "
            "it with `visavis devices luminance`"
        )
    return problems

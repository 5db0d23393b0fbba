"""Read the areas of interest of a picture or film: YAML, CSV of corners, SVG, or a painted PNG.

Of a panorama YAML and CSV give degrees: to the right of the picture's middle, and upwards. An area
may reach across the picture's edge, as 170 to 190 does; areas are counted in pixels all the same.
Of a film YAML and CSV may give key frames, by seconds or by the number of a picture from 0.
"""

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import ConfigError, DesignError
from visavis.lab.foreign_text import require_csv
from visavis.lab.plain_files import read_plain
from visavis.lab.yaml_lines import Document, did_you_mean, names_or_none, read_document
from visavis.stimuli.areas import Area, KeyFrame, Outline, pack_runs, signed_size_px2
from visavis.stimuli.film_file import FilmFacts
from visavis.stimuli.flat import COLOURS, rgb_of
from visavis.stimuli.flat_pixels import read_picture

SUFFIXES: Final = (".yaml", ".yml", ".csv", ".svg", ".png")
FORMS: Final = ("polygon", "rectangle", "ellipse", "mask")
PER_AREA: Final = (*FORMS, "keys", "colour", "salience", "turn_deg")
TIMES: Final = ("t_s", "frame")
PER_KEY: Final = (*TIMES, "polygon", "rectangle", "ellipse", "turn_deg", "gone")
COLOUR_NAMES: Final = {rgb: name for name, rgb in COLOURS.items() if name not in ("gray", "black")}
NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
MAX_BYTES: Final = 16 * 1024 * 1024
OPAQUE: Final = 128
MAX_CORNERS: Final = 20_000
"""Of all areas of a file; every edge is compared with every other of its area."""
COLOURS_NAMED: Final = 8
ON_THE_WAY: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the way between two key frames at which an outline is looked at."""


def read_areas(
    path: Path,
    size_px: tuple[int, int],
    *,
    is_around: bool = False,
    film: FilmFacts | None = None,
) -> tuple[Area, ...]:
    """Return the areas of a picture of so many pixels, in the order of their file; `is_around`
    tells of a panorama, `film` of a film.

    Raises:
        DesignError: the file cannot be read, has none, or one is not possible, with its line.
    """
    modified_ns = path.stat().st_mtime_ns if path.is_file() else 0
    return _read(path, modified_ns, size_px, is_around, film)


def area_names(path: Path) -> frozenset[str]:
    """Return the names of the areas in a file, without the picture that they are on.

    Raises:
        DesignError: the file cannot be read.
    """
    suffix = path.suffix.lower()
    if suffix == ".png":
        names = {text for text, _ in _colours_of(np.asarray(read_picture(path)))}
    elif suffix == ".svg":
        names = {name for _, name, _ in _shapes_of(_svg_root(path))}
    elif suffix == ".csv":
        names = {row.get("area", "") for _, row in _rows_of_csv(path, ())}
    else:
        names = {str(name) for name in _document_of(path).data or {}}
    return frozenset(names - {""})


@lru_cache(maxsize=512)
def _read(
    path: Path,
    modified_ns: int,
    size_px: tuple[int, int],
    is_around: bool,
    film: FilmFacts | None = None,
) -> tuple[Area, ...]:
    if not path.is_file():
        near = did_you_mean(path.name, (p.name for p in path.parent.glob("*.*") if p.is_file()))
        near = near if near.startswith("; did") else "; put it beside the study's file"
        raise DesignError(f"there is no file of areas {path}{near}")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DesignError(f"{path}: areas are read from {', '.join(SUFFIXES)}")
    if suffix == ".png":
        areas = list(_of_png(path, size_px))
    elif suffix == ".svg":
        areas = list(_of_svg(path, size_px))
    elif suffix == ".csv":
        areas = list(_of_csv(path, ("yaw_deg", "pitch_deg") if is_around else ("x", "y"), film))
    else:
        areas = list(_of_yaml(path, size_px, is_around, film))
    if is_around and suffix not in (".png", ".svg"):
        areas = [(where, _from_degrees(area, size_px)) for where, area in areas]
    if not areas:
        why_none = ": every pixel is black, or less than half opaque" if suffix == ".png" else ""
        raise DesignError(f"{path} has no areas{why_none}; describe or paint one at least")
    corners = sum(len(area.outline) for _, area in areas)
    corners += sum(len(key.outline) for _, area in areas for key in area.keys)
    if corners > MAX_CORNERS:
        raise DesignError(
            f"{path}: its outlines have {corners} corners; {MAX_CORNERS} at most. Simplify "
            "them, or paint the areas"
        )
    first_at: dict[str, str] = {}
    for where, area in areas:
        _check_keys(where, area)
        for key in (key for key in area.keys if not key.is_gone):
            still = Area(area.name, key.outline, key.ellipse, salience=area.salience)
            _check(f"{where}, at {key.t_s:g} s", still, size_px, is_around)
        _check_ways(where, area)
        if not area.keys:
            _check(where, area, size_px, is_around)
        if area.name in first_at:
            raise DesignError(f"{where}: there are two areas {area.name!r}; name one otherwise")
        first_at[area.name] = where
    return tuple(area for _, area in areas)


def _from_degrees(area: Area, size_px: tuple[int, int]) -> Area:
    """Return an area of a panorama in pixels that is in degrees to the right and upwards."""
    wide, high = size_px
    px_per_deg = high / 180.0

    def place(right_deg: float, up_deg: float) -> tuple[float, float]:
        return wide / 2 + right_deg * px_per_deg, high / 2 - up_deg * px_per_deg

    def form(of: Area | KeyFrame) -> dict[str, Any]:
        ellipse = of.ellipse
        if ellipse is not None:
            x, y, wide_deg, high_deg, turn_deg = ellipse
            ellipse = (*place(x, y), wide_deg * px_per_deg, high_deg * px_per_deg, turn_deg)
        return {"outline": tuple(place(x, y) for x, y in of.outline), "ellipse": ellipse}

    keys = tuple(replace(key, **form(key)) for key in area.keys)
    return replace(area, **form(area), keys=keys)


def _check(where: str, area: Area, size_px: tuple[int, int], is_around: bool) -> None:
    """Refuse an area with a name, form or place that is not possible."""
    if not area.name.isidentifier():
        raise DesignError(
            f"{where}: an area is called {area.name!r}; columns bear its name: give letters, "
            "digits and _"
        )
    if area.salience is not None and not 0 < area.salience < np.inf:
        raise DesignError(f"{where}: the salience of {area.name} is {area.salience}; above 0")
    if area.pixels:
        return
    corners = area.corners()
    if not np.isfinite(corners).all():
        raise DesignError(f"{where}: a corner of {area.name} is no number")
    if area.ellipse is None and len(corners) < 3:
        raise DesignError(
            f"{where}: area {area.name} has {len(corners)} corners; it takes three at least"
        )
    crossing = None if area.ellipse else _crossing(corners)
    if crossing is not None:
        raise DesignError(
            f"{where}: the outline of area {area.name} crosses itself between corners "
            f"{crossing[0] + 1} and {crossing[1] + 1}; give its corners in order"
        )
    if not area.size_px2() > 0 or (area.ellipse and min(area.ellipse[2:4]) < 0):
        raise DesignError(f"{where}: area {area.name} is empty: its corners lie on one line")
    beyond = (corners < -1e-6) | (corners > np.array(size_px) + 1e-6)
    if is_around:
        if np.ptp(corners[:, 0]) > size_px[0] + 1e-6 or beyond[:, 1].any():
            raise DesignError(
                f"{where}: area {area.name} does not fit around: 360 degrees wide at most, from "
                "-90 to 90 upwards"
            )
        if np.abs(corners[:, 0] - size_px[0] / 2).max() > size_px[0] + 1e-6:
            raise DesignError(f"{where}: area {area.name}: give yaws from -360 to 360")
        return
    if beyond.any():
        x, y = corners[beyond.any(axis=1)][0]
        raise DesignError(
            f"{where}: area {area.name} reaches to ({x:g}, {y:g}), outside its picture of "
            f"{size_px[0]} × {size_px[1]} pixels"
        )


def _check_keys(where: str, area: Area) -> None:
    """Refuse key frames between which nothing can move."""
    keys = area.keys
    for one, later in pairwise(keys):
        if later.t_s <= one.t_s:
            raise DesignError(
                f"{where}: the key frames of area {area.name} go from {one.t_s:g} to "
                f"{later.t_s:g} s; give them in order, each time once"
            )
    there = [key for key in keys if not key.is_gone]
    for one, later in pairwise(there):
        kinds = [
            f"{len(key.outline)} corners" if key.outline else "an ellipse" for key in (one, later)
        ]
        if kinds[0] != kinds[1]:
            raise DesignError(
                f"{where}: area {area.name} is {kinds[0]} at {one.t_s:g} s and {kinds[1]} at "
                f"{later.t_s:g} s; give as many corners each time, in the same order"
            )
    if keys and (len(keys) < 2 or not there):
        raise DesignError(
            f"{where}: area {area.name} takes two key frames at least: where it is, and where it "
            "is last, or that it is gone"
        )


def _check_ways(where: str, area: Area) -> None:
    """Refuse key frames whose corners are not in the same order."""
    for one, later in pairwise(area.keys):
        if one.outline and later.outline and _turns_over(one.outline, later.outline):
            raise DesignError(
                f"{where}: area {area.name} turns inside out or crosses itself on the way from "
                f"{one.t_s:g} to {later.t_s:g} s; give the same corners in the same order each "
                "time, or key frames between"
            )


def _turns_over(outline: Outline, later: Outline) -> bool:
    """Tell whether an outline is flat or crosses itself on the way to a later one."""
    begin, end = np.array(outline), np.array(later)
    ways = [begin + share * (end - begin) for share in ON_THE_WAY]
    # The size is a parabola of the share, here through its values at begin, middle and end.
    first, middle, last = (signed_size_px2(ways[k]) for k in (0, len(ways) // 2, -1))
    bend, slope = 2.0 * (first + last - 2.0 * middle), 4.0 * middle - 3.0 * first - last
    turn = -slope / (2.0 * bend) if bend else 0.0
    areas_px2 = [first, last]
    if 0.0 < turn < 1.0:
        areas_px2.append(first + slope * turn + bend * turn**2)
    is_flat = min(areas_px2) <= 0 <= max(areas_px2)
    return is_flat or any(_crossing(corners) is not None for corners in ways[1:-1])


def _time_s(where: str, name: str, of: Mapping[str, Any], film: FilmFacts | None) -> float:
    """Return when a key frame is, in seconds of its film.

    Raises:
        DesignError: there is no film, no such time, or none in the film.
    """
    if film is None:
        raise DesignError(
            f"{where}: area {name} has key frames, which are for films: Video(…, areas=…) "
            "or the Panorama of a film"
        )
    units = [time for time in TIMES if of.get(time) not in (None, "")]
    if len(units) != 1:
        raise DesignError(f"{where}: area {name}: give each key frame its t_s or its frame")
    (unit,) = units
    try:
        time = float(of[unit])
    except (TypeError, ValueError, OverflowError) as error:
        raise DesignError(f"{where}: area {name}: {unit} is {of[unit]!r}; a number") from error
    pictures = len(film.stamps_s)
    if unit == "frame":
        if not (time.is_integer() and 0 <= time < pictures):
            raise DesignError(
                f"{where}: area {name}: its film has no frame {of[unit]}; 0 to {pictures - 1}"
            )
        return float(film.stamps_s[int(time)])
    if not 0.0 <= time <= film.seconds:
        raise DesignError(
            f"{where}: area {name} has a key frame at {time:g} s, outside its film of "
            f"{film.seconds:.6g} s"
        )
    return time


def _crossing(corners: npt.NDArray[np.float64]) -> tuple[int, int] | None:
    """Return two edges of an outline that cross; None without any."""
    ends = np.roll(corners, -1, axis=0)
    n = len(corners)

    def side(a: Any, b: Any, c: Any) -> Any:
        return np.sign(
            (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        )

    for i in range(n - 2):
        others = np.arange(i + 2, n - (i == 0))
        a, b = corners[i], ends[i]
        c, d = corners[others], ends[others]
        crosses = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
        if crosses.any():
            return i, int(others[crosses.argmax()])
    return None


def _of_yaml(
    path: Path, size_px: tuple[int, int], is_around: bool, film: FilmFacts | None
) -> Iterator[tuple[str, Area]]:
    document = _document_of(path)
    for name, of in (document.data or {}).items():
        where = f"{path}, line {document.line_of((str(name),))}"
        if not isinstance(of, dict):
            raise DesignError(f"{where}: area {name}: write {{polygon: [[x, y], …]}} or the like")
        for key in of:
            if key not in PER_AREA:
                raise DesignError(f"{where}: area {name}: {key!r}{did_you_mean(key, PER_AREA)}")
        forms = [form for form in (*FORMS, "keys") if form in of]
        if len(forms) != 1:
            raise DesignError(f"{where}: area {name}: give one of {', '.join(FORMS)}, keys")
        if is_around and "mask" in of:
            raise DesignError(
                f"{where}: area {name}: a mask of a panorama is a PNG of its own, in the place of "
                "this file"
            )
        of, downwards = dict(of), -1 if is_around else 1
        keys = [
            _key_of(where, path, str(name), key, size_px, film, downwards)
            for key in _list_of_keys(where, str(name), of.pop("keys", []))
        ]
        _refuse_idle(where, str(name), of)
        area = _area_of(where, path, str(name), of, size_px, downwards)
        yield where, replace(area, keys=tuple(keys))


def _document_of(path: Path) -> Document:
    """Return a YAML file of areas, which names them.

    Raises:
        DesignError: it cannot be read, or is something else.
    """
    try:
        document = read_document(path)
    except ConfigError as error:
        raise DesignError(str(error)) from error
    if document.problems:
        problem = document.problems[0]
        raise DesignError(f"{path}, line {problem.line}: {problem.key}: {problem.message}")
    if not isinstance(document.data or {}, dict):
        raise DesignError(f"{path}: write NAME: {{polygon: [[x, y], …]}} for each area")
    return document


def _list_of_keys(where: str, name: str, keys: Any) -> list[Mapping[str, Any]]:
    """Return the key frames that an area lists.

    Raises:
        DesignError: it lists none.
    """
    if not isinstance(keys, list) or not all(isinstance(key, dict) for key in keys):
        raise DesignError(
            f"{where}: area {name}: keys is a list of key frames: [{{t_s: 0, ellipse: […]}}, …]"
        )
    return keys


def _key_of(
    where: str,
    path: Path,
    name: str,
    of: Mapping[str, Any],
    size_px: tuple[int, int],
    film: FilmFacts | None,
    downwards: int,
) -> KeyFrame:
    for word in of:
        if word not in PER_KEY:
            raise DesignError(f"{where}: area {name}: {word!r}{did_you_mean(word, PER_KEY)}")
    t_s = _time_s(where, name, of, film)
    forms = [form for form in ("polygon", "rectangle", "ellipse", "gone") if of.get(form)]
    if len(forms) != 1:
        raise DesignError(
            f"{where}: area {name}: give its key frame at {t_s:g} s one of polygon, rectangle, "
            "ellipse, gone: true"
        )
    _refuse_idle(where, name, of)
    area = (
        Area(name) if "gone" in forms else _area_of(where, path, name, dict(of), size_px, downwards)
    )
    return KeyFrame(t_s, area.outline, area.ellipse)


def _refuse_idle(where: str, name: str, of: Mapping[str, Any]) -> None:
    """Refuse what would change nothing about the form that an area has."""
    for word, form in (("turn_deg", "ellipse"), ("colour", "mask")):
        if word in of and form not in of:
            raise DesignError(
                f"{where}: area {name}: {word} goes with {form}; leave it out, or give a polygon"
            )


def _area_of(
    where: str,
    path: Path,
    name: str,
    of: dict[str, Any],
    size_px: tuple[int, int],
    downwards: int,
) -> Area:
    """Return an area as it is described; `downwards` is the sign of what lies below."""
    salience = of.get("salience")
    if salience is not None and (
        isinstance(salience, bool) or not isinstance(salience, int | float)
    ):
        raise DesignError(f"{where}: area {name}: salience is {salience!r}; a number above 0")
    try:
        if "mask" in of:
            picture = path.parent / str(of["mask"])
            try:
                colour = rgb_of(of.get("colour", ""))
                labels = _mask(picture, size_px)
            except DesignError as error:
                raise DesignError(f"{where}: area {name}: {error}") from error
            is_inside = (labels[..., :3] == colour).all(axis=-1) & (labels[..., 3] >= OPAQUE)
            if not is_inside.any():
                there = [colour for colour, _ in islice(_colours_of(labels), COLOURS_NAMED)]
                raise DesignError(
                    f"{where}: no pixel of {picture.name} has the colour {of['colour']!r} "
                    f"({_hex(colour)}) of area {name}; there are {names_or_none(there)}"
                )
            return Area(name, pixels=pack_runs(is_inside), salience=salience)
        if "ellipse" in of:
            x, y, wide, high = map(float, of["ellipse"])
            turn = float(of.get("turn_deg", 0.0))
            return Area(name, ellipse=(x, y, wide, high, turn), salience=salience)
        if "rectangle" in of:
            left, top, wide, high = map(float, of["rectangle"])
            return Area(name, _rectangle(left, top, wide, downwards * high), salience=salience)
        outline = tuple((float(x), float(y)) for x, y in of.get("polygon", ()))
        return Area(name, outline, salience=salience)
    except (TypeError, ValueError, OverflowError) as error:
        raise DesignError(
            f"{where}: area {name}: polygon is [[x, y], …], rectangle [left, top, width, height], "
            "ellipse [x, y, width, height] around its middle, all in pixels; of a panorama in "
            "degrees, x to the right of its middle and y upwards"
        ) from error


def _rectangle(left: float, top: float, wide: float, high: float) -> Outline:
    right, bottom = left + wide, top + high
    return (left, top), (right, top), (right, bottom), (left, bottom)


def _of_csv(
    path: Path, axes: tuple[str, str], film: FilmFacts | None
) -> Iterator[tuple[str, Area]]:
    corners: dict[str, dict[float | None, list[tuple[float, float]]]] = {}
    lines: dict[str, int] = {}
    saliences: dict[str, float] = {}
    last: tuple[str, float | None] = "", None
    for line, row in _rows_of_csv(path, axes):
        name = row.get("area", "")
        where, t_s = f"{path}, line {line}", None
        if any(row.get(time) for time in TIMES):
            t_s = _time_s(where, name, row, film)
        outlines = corners.setdefault(name, {})
        if (name in lines and name != last[0]) or (t_s in outlines and t_s != last[1]):
            raise DesignError(
                f"{where}: area {name!r} begins a second time (first in line {lines[name]}); its "
                "corners follow one another, and names stand once"
            )
        if outlines and (t_s is None) != (last[1] is None):
            raise DesignError(f"{where}: area {name}: a key frame lacks its time; give each one")
        try:
            if row.get("salience"):
                saliences[name] = float(row["salience"])
            of = outlines.setdefault(t_s, [])
            if t_s is None or row.get(axes[0]) or row.get(axes[1]):  # else it is gone
                of.append((float(row.get(axes[0], "")), float(row.get(axes[1], ""))))
        except ValueError as error:
            raise DesignError(
                f"{where}: area {name}: {error}; write numbers with a point"
            ) from error
        lines.setdefault(name, line)
        last = name, t_s
    for name, outlines in corners.items():
        still = tuple(outlines.pop(None, ()))
        keys = tuple(KeyFrame(t_s, tuple(of)) for t_s, of in outlines.items() if t_s is not None)
        area = Area(name, still, salience=saliences.get(name), keys=keys)
        yield f"{path}, line {lines[name]}", area


def _rows_of_csv(path: Path, axes: Sequence[str]) -> Iterator[tuple[int, Mapping[str, str]]]:
    """Yield the rows of a table of areas that are not empty, each with its line.

    Raises:
        DesignError: the file cannot be read, or lacks a column.
    """
    text = _text(path)
    head = text.partition("\n")[0]
    delimiter = max(",;\t", key=head.count)
    require_csv(path, text, delimiter)
    rows = csv.DictReader(io.StringIO(text, newline=None), delimiter=delimiter)
    there = [name.strip() for name in rows.fieldnames or ()]
    missing = [name for name in ("area", *axes) if name not in there]
    if missing:
        raise DesignError(
            f"{path}: there is no column {missing[0]!r}; a table of areas has area, "
            f"{' and '.join(axes)}, one row for each corner, in order"
        )
    for raw in rows:
        row = {str(k).strip(): (v or "").strip() for k, v in raw.items() if isinstance(v, str)}
        if any(row.values()):
            yield rows.line_num, row


def _of_svg(path: Path, size_px: tuple[int, int]) -> Iterator[tuple[str, Area]]:
    root = _svg_root(path)
    box = _numbers(root.get("viewBox", ""))
    if not box:
        extent = [v for n in ("width", "height") for v in _numbers(root.get(n, ""))[:1]]
        box = [0.0, 0.0, *(extent or map(float, size_px))]
    if len(box) != 4 or min(box[2:]) <= 0:
        raise DesignError(f"{path}: its viewBox is {root.get('viewBox')!r}; four numbers")
    left, top, wide, high = box
    if abs(wide / high * size_px[1] / size_px[0] - 1) > 0.01:
        raise DesignError(
            f"{path} is drawn on {wide:g} × {high:g}, and its picture has {size_px[0]} × "
            f"{size_px[1]} pixels; draw it over the picture, with the same shape"
        )
    scale = size_px[0] / wide, size_px[1] / high
    transforms = _moved_by_transforms(root)
    for kind, name, element in _shapes_of(root):
        where = f"{path}, {kind} {name!r}"
        if element in transforms:
            raise DesignError(f"{where} is moved by a transform; apply it in the drawing program")
        area = _svg_area(where, kind, name, element)
        outline = tuple(((x - left) * scale[0], (y - top) * scale[1]) for x, y in area.outline)
        ellipse = area.ellipse
        if ellipse is not None:
            x, y, w, h, turn = ellipse
            x, y = (x - left) * scale[0], (y - top) * scale[1]
            ellipse = x, y, w * scale[0], h * scale[1], turn
        salience = _numbers(element.get("data-salience", ""))[:1]
        yield (
            where,
            replace(area, outline=outline, ellipse=ellipse, salience=next(iter(salience), None)),
        )


def _svg_root(path: Path) -> ElementTree.Element:
    text = _text(path)
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DesignError(f"{path}: save it as a plain SVG, without a DOCTYPE")
    try:
        return ElementTree.fromstring(text)  # noqa: S314 - entities are refused above
    except ElementTree.ParseError as error:
        raise DesignError(f"{path} is no SVG: {error}") from error


def _shapes_of(root: ElementTree.Element) -> Iterator[tuple[str, str, ElementTree.Element]]:
    """Yield what is drawn: its kind, its name and its element."""
    for element in root.iter():
        kind = str(element.tag).rpartition("}")[2]
        if kind in ("polygon", "rect", "circle", "ellipse", "path", "polyline"):
            yield kind, element.get("id", ""), element


def _moved_by_transforms(root: ElementTree.Element) -> set[ElementTree.Element]:
    """Return the elements that bear a transform, and all within them."""
    groups, ahead = set(), [(root, False)]
    while ahead:
        element, is_moved = ahead.pop()
        is_moved = is_moved or bool(element.get("transform"))
        if is_moved:
            groups.add(element)
        ahead += [(one, is_moved) for one in element]
    return groups


def _svg_area(where: str, kind: str, name: str, element: ElementTree.Element) -> Area:
    def number(key: str) -> float:
        numbers = _numbers(element.get(key, "0"))
        return numbers[0] if numbers else 0.0

    if kind == "rect":
        return Area(name, _rectangle(*(number(k) for k in ("x", "y", "width", "height"))))
    if kind in ("circle", "ellipse"):
        radii = ("r", "r") if kind == "circle" else ("rx", "ry")
        wide, high = (2 * number(r) for r in radii)
        return Area(name, ellipse=(number("cx"), number("cy"), wide, high, 0.0))
    if kind == "path":
        return Area(name, _path(where, element.get("d", "")))
    flat = _numbers(element.get("points", ""))
    return Area(name, tuple(zip(flat[::2], flat[1::2], strict=False)))


def _path(where: str, text: str) -> tuple[tuple[float, float], ...]:
    """Return the corners of a path of straight lines."""
    corners: list[tuple[float, float]] = []
    x = y = 0.0
    for command, rest in re.findall(r"([A-Za-z])([^A-Za-z]*)", re.sub(r"(?<=\d)[eE]", "e", text)):
        values = _numbers(rest)
        is_relative, kind = command.islower(), command.upper()
        if kind == "Z":
            continue
        if kind not in "MLHV" or (kind == "M" and corners):
            raise DesignError(
                f"{where} has curves or several pieces ({command}); draw straight lines, or paint"
            )
        pairs: Sequence[tuple[float | None, float | None]]
        if kind == "H":
            pairs = [(v, None) for v in values]
        elif kind == "V":
            pairs = [(None, v) for v in values]
        else:
            pairs = list(zip(values[::2], values[1::2], strict=False))
        for right, down in pairs:
            x = x if right is None else right + (x if is_relative else 0.0)
            y = y if down is None else down + (y if is_relative else 0.0)
            corners.append((x, y))
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners.pop()
    return tuple(corners)


def _numbers(text: str) -> list[float]:
    return [float(v) for v in NUMBER.findall(text)]


def _of_png(path: Path, size_px: tuple[int, int]) -> Iterator[tuple[str, Area]]:
    labels = _mask(path, size_px)
    for text, is_inside in _colours_of(labels):
        if text.startswith("#"):
            row, column = np.argwhere(is_inside)[0]
            raise DesignError(
                f"{path}: {int(is_inside.sum())} pixels have the colour {text}, the first at "
                f"({column}, {row}), which names no area; paint without smoothed edges with "
                f"{', '.join(f'{name} ({_hex(rgb)})' for rgb, name in COLOUR_NAMES.items())}, or "
                "name colours in a YAML file"
            )
        yield f"{path}, {text}", Area(text, pixels=pack_runs(is_inside))


def _mask(path: Path, size_px: tuple[int, int]) -> npt.NDArray[np.uint8]:
    picture = read_picture(path)
    if picture.size != size_px:
        wide, high = picture.size
        raise DesignError(
            f"{path} has {wide} × {high} pixels, and its picture {size_px[0]} × {size_px[1]}; "
            "paint it over the picture, with the same size"
        )
    return np.asarray(picture)


def _colours_of(labels: npt.NDArray[np.uint8]) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
    """Yield each colour that was painted, by its name or "#rrggbb", and where; black is none.

    A photograph has millions: who names some takes no more of them.
    """
    red, green, blue = (labels[..., i].astype(np.int32) for i in range(3))
    rgb_of_pixel = np.where(labels[..., 3] >= OPAQUE, (red << 16) | (green << 8) | blue, 0)
    for value in np.unique(rgb_of_pixel[rgb_of_pixel != 0]).tolist():
        rgb = value >> 16, value >> 8 & 255, value & 255
        yield COLOUR_NAMES.get(rgb, f"#{value:06x}"), rgb_of_pixel == value


def _hex(rgb: Sequence[int]) -> str:
    return "#{:02x}{:02x}{:02x}".format(*rgb)


def _text(path: Path) -> str:
    try:
        return read_plain(path, max_bytes=MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DesignError(f"{path} is not UTF-8; save it so") from error

"""Find what a BIDS data set says about one of its files: sidecars are inherited from folders above.

Source: BIDS 1.11, "The inheritance principle" and "Task events" (StimulusPresentation).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Any

from visavis.lab.errors import DataError
from visavis.lab.foreign_text import decode_text
from visavis.lab.plain_files import parse_json, read_plain
from visavis.lab.screen import FlatScreen

DESCRIPTION = "dataset_description.json"
MAX_SCREEN_M = 20.0


def data_set_of(path: Path) -> Path | None:
    """Return the root of the data set that a file lies in; None where there is none."""
    return next((p for p in path.resolve().parents if (p / DESCRIPTION).is_file()), None)


def sidecar_of(path: Path, suffix: str | None = None) -> dict[str, Any]:
    """Return what the sidecars of a data file say together; the nearest one has the last word.

    A JSON file of the same suffix (or of `suffix`, such as "events") applies when it lies in the
    file's folder or above, up to the root, and all its entities are the file's.

    Raises:
        DataError: a sidecar cannot be read, or is no JSON object.
    """
    stem = path.name.partition(".")[0]
    own_suffix = stem.rpartition("_")[2] if suffix is None else suffix
    entities = set(stem.split("_")[:-1])
    content: dict[str, Any] = {}
    for folder in _folders(path):
        fitting = []
        for side in folder.glob(f"*{own_suffix}.json"):
            *parts, last = side.name.removesuffix(".json").split("_")
            if last == own_suffix and entities.issuperset(parts):
                fitting.append((len(parts), side))
        for _, side in sorted(fitting):
            content |= _read(side)
    return content


def _folders(path: Path) -> list[Path]:
    """Return the folders from the data set's root down to the file's."""
    folder, root = path.resolve().parent, data_set_of(path)
    if root is None:
        return [folder]
    above = [folder, *folder.parents]
    return [*takewhile(lambda p: p != root, above), root][::-1]


def _read(side: Path) -> Mapping[str, Any]:
    try:
        text, _ = decode_text(read_plain(side))
        content = parse_json(text)
    except (OSError, ValueError) as error:
        raise DataError(f"{side}: not JSON ({error}); mend the sidecar") from error
    if not isinstance(content, dict):
        raise DataError(f"{side}: not a JSON object; mend the sidecar")
    return content


@dataclass(frozen=True)
class DescribedScreen:
    """A screen straight before the middle of the eyes, as a data set describes it.

    Whether its pixels are counted from the right, and from the bottom; `remarks` say what was read
    otherwise than it stands.
    """

    screen: FlatScreen
    from_right_and_bottom: tuple[bool, bool]
    remarks: tuple[str, ...] = ()


def screen_in_set(path: Path) -> DescribedScreen | None:
    """Return the screen that a recording's data set describes; None where it does not.

    A resolution that is odd in both directions, such as 1023 by 767, names the last pixel, as
    eye2bids takes it from EyeLink's GAZE_COORDS: screens have even numbers of pixels.

    Raises:
        DataError: sizes that no screen has.
    """
    geometry: dict[str, Any] = {}
    for content in (sidecar_of(path, "events"), sidecar_of(path)):
        geometry |= dict(content.get("StimulusPresentation") or {})
        geometry |= {k: v for k, v in content.items() if k.startswith("Screen")}
    try:
        width_m, height_m = (float(v) for v in geometry["ScreenSize"])
        width_px, height_px = (int(v) for v in geometry["ScreenResolution"])
        distance_m = float(geometry["ScreenDistance"])
    except (KeyError, TypeError, ValueError):
        return None
    if not (0 < min(width_m, height_m, distance_m) and min(width_px, height_px) > 0):
        raise DataError(f"{path}: StimulusPresentation describes a screen without size")
    if max(width_m, height_m, distance_m) > MAX_SCREEN_M:
        raise DataError(
            f"{path}: StimulusPresentation describes a screen of {width_m:g} by {height_m:g} m at "
            f"{distance_m:g} m; BIDS wants metres: were these cm or mm?"
        )
    origin = {str(word).lower() for word in geometry.get("ScreenOrigin") or ()}
    remarks: tuple[str, ...] = ()
    if width_px % 2 and height_px % 2:
        remarks = (
            f"ScreenResolution {width_px} x {height_px} names the last pixel: read as "
            f"{width_px + 1} x {height_px + 1}; --screen says otherwise",
        )
        width_px, height_px = width_px + 1, height_px + 1
    screen = FlatScreen(width_m, height_m, width_px, height_px, distance_m)
    return DescribedScreen(screen, ("right" in origin, "bottom" in origin), remarks)

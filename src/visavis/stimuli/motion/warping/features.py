"""Visual features of the perceived image, and the wanted changes of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.warping.perceived import mask_of
from visavis.stimuli.motion.warping.raster_kernels import (
    Bytes,
    fine_extension,
    measure,
    measure_change,
)

Custom = Callable[[Bytes, npt.NDArray[np.bool_]], float]
"""A feature of a user: perceived parts (h, w) and the wanted ones (256,) to a number."""

BUILT_IN: Final = ("coverage", "horizontal_extension", "vertical_extension", "motion_coverage")
"""Share of pixels, share of width, share of height, share of pixels that changed."""

EDGE_PX: Final = 6.0
"""Pixels that lie outside of either edge of an extension that is measured finely."""

_CUSTOM: dict[str, Custom] = {}


def register_feature(name: str, measure_one: Custom) -> None:
    """Add a scalar feature under a new name; it must be 0 where nothing is perceived.

    Raises:
        MotionError: the name is taken.
    """
    if name in BUILT_IN or name in _CUSTOM:
        raise MotionError(f"there is already a visual feature {name!r}; choose another name")
    _CUSTOM[name] = measure_one


def feature_names() -> tuple[str, ...]:
    """Return every feature that can be asked for."""
    return (*BUILT_IN, *_CUSTOM)


@dataclass(frozen=True)
class FeatureTarget:
    """A feature summed over parts and how much it shall change: +0.25 is a quarter more.

    `weight` scales its error against those of others.
    """

    kind: str
    parts: tuple[str, ...]
    change: float
    weight: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in feature_names():
            raise MotionError(
                f"there is no visual feature {self.kind!r}; choose from "
                f"{', '.join(feature_names())}"
            )
        if not self.parts:
            raise MotionError(f"feature {self.kind!r} names no body part")
        if not (np.isfinite(self.change) and self.change >= -1.0 and self.weight > 0):
            raise MotionError(
                f"feature {self.kind!r} shall change by {self.change} with weight {self.weight}; "
                "give a change of at least -1 (nothing left) and a weight above 0"
            )
        mask_of(self.parts)


def parse_feature(text: str) -> FeatureTarget:
    """Read "coverage:face,right_hand:+0.25".

    Raises:
        MotionError: the text has another form, or names something unknown.
    """
    pieces = text.split(":")
    if len(pieces) != 3:
        raise MotionError(f"feature {text!r}; write KIND:PART,PART:CHANGE, as coverage:face:+0.25")
    kind, parts, change = pieces
    try:
        number = float(change)
    except ValueError:
        raise MotionError(f"feature {text!r} has no number as its change; write +0.25") from None
    return FeatureTarget(kind, tuple(p.strip() for p in parts.split(",") if p.strip()), number)


def values_of(
    targets: tuple[FeatureTarget, ...], ids: Bytes, before: Bytes | None = None
) -> Vector:
    """Measure features of perceived parts (n, h, w): (n, f).

    `before` (n, h, w) or (h, w) is what was perceived a frame earlier; without it nothing moved.
    """
    masks = np.array([mask_of(t.parts) for t in targets])
    values = np.zeros((len(ids), len(targets)))
    plain = np.empty((len(ids), len(targets), 3))
    measure(ids, masks, plain)
    shares = np.zeros((len(ids), len(targets)))
    if before is not None and any(t.kind == "motion_coverage" for t in targets):
        measure_change(ids, np.ascontiguousarray(np.broadcast_to(before, ids.shape)), masks, shares)
    for f, target in enumerate(targets):
        if target.kind == "motion_coverage":
            values[:, f] = shares[:, f]
        elif target.kind in BUILT_IN:
            values[:, f] = plain[:, f, BUILT_IN.index(target.kind)]
        else:
            values[:, f] = [_CUSTOM[target.kind](one, masks[f]) for one in ids]
    return values


def fine_values_of(
    targets: tuple[FeatureTarget, ...], ids: Bytes, before: Bytes | None = None
) -> Vector:
    """Measure features (n, f) for their differences: extensions in fractions of a pixel.

    An extension in whole pixels does not change at all under most small turns. Here it ends where
    `EDGE_PX` pixels are left, which moves as the tip does; it is some pixels shorter.
    """
    values = values_of(targets, ids, before)
    fine = np.empty(len(ids))
    for f, target in enumerate(targets):
        if target.kind in ("horizontal_extension", "vertical_extension"):
            across = target.kind == "horizontal_extension"
            fine_extension(ids, mask_of(target.parts), across, EDGE_PX, fine)
            is_finite = np.isfinite(fine)
            values[is_finite, f] = fine[is_finite] / ids.shape[2 if across else 1]
    return values


def pixel_of(target: FeatureTarget, size_px: tuple[int, int]) -> float:
    """Return the least change of a feature that a buffer of this size can show."""
    height, width = size_px
    if target.kind == "horizontal_extension":
        return 1.0 / width
    if target.kind == "vertical_extension":
        return 1.0 / height
    return 1.0 / (height * width)


def grain_of(target: FeatureTarget, value: float, size_px: tuple[int, int]) -> float:
    """Return by how much a feature of this value is uncertain in a buffer of this size.

    An extension by a pixel. An area of N pixels has an outline of some 4 √N, each of which falls
    in or out by chance: N^¼ pixels.
    """
    pixel = pixel_of(target, size_px)
    if target.kind in ("coverage", "motion_coverage"):
        return float(max(1.0, (value / pixel) ** 0.25) * pixel)
    return pixel

"""Shape the base mesh into one person: sex, age, build and the details of a face."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Literal

import numpy as np

from character_making.makehuman import MakeHuman
from visavis.lab.geometry import Vector


@dataclass(frozen=True)
class Shape:
    """A body. `muscle`, `weight`, `height`, `proportions`, `cup` and `firmness` run from −1 to 1
    about the average; `origins` are shares of the three ancestries of the base mesh that sum to
    1; `details` are amounts of single shapes by their path, `~` standing for both sides.
    """

    gender: Literal["female", "male"]
    age_years: float
    muscle: float = 0.0
    weight: float = 0.0
    height: float = 0.0
    proportions: float = 0.0
    cup: float = 0.0
    firmness: float = 0.0
    origins: Mapping[str, float] = field(default_factory=lambda: {"caucasian": 1.0})
    details: Mapping[str, float] = field(default_factory=dict)


def _levels(amount: float, low: str, middle: str, high: str) -> list[tuple[str, float]]:
    """Split −1…1 into shares of the two neighbouring levels."""
    side = high if amount > 0 else low
    return [(middle, 1 - abs(amount)), (side, abs(amount))]


def _macros(shape: Shape) -> list[tuple[str, float]]:
    """Return the whole-body shapes and how much of each."""
    old = float(np.clip((shape.age_years - 25.0) / 65.0, 0.0, 1.0))
    ages = [("young", 1 - old), ("old", old)]
    muscles = _levels(shape.muscle, "minmuscle", "averagemuscle", "maxmuscle")
    weights = _levels(shape.weight, "minweight", "averageweight", "maxweight")
    amounts: list[tuple[str, float]] = []
    for (age, a), (origin, o) in product(ages, shape.origins.items()):
        amounts.append((f"macrodetails/{origin}-{shape.gender}-{age}", a * o))
    for (age, a), (muscle, m), (weight, w) in product(ages, muscles, weights):
        share, build = a * m * w, f"{shape.gender}-{age}-{muscle}-{weight}"
        amounts.append((f"macrodetails/universal-{build}", share))
        if shape.height:
            end = "maxheight" if shape.height > 0 else "minheight"
            amounts.append((f"macrodetails/height/{build}-{end}", share * abs(shape.height)))
        if shape.proportions:
            end = "idealproportions" if shape.proportions > 0 else "uncommonproportions"
            path = f"macrodetails/proportions/{build}-{end}"
            amounts.append((path, share * abs(shape.proportions)))
        if shape.gender == "female":
            cups = _levels(shape.cup, "mincup", "averagecup", "maxcup")
            firm = _levels(shape.firmness, "minfirmness", "averagefirmness", "maxfirmness")
            for (cup, c), (firmness, f) in product(cups, firm):
                if (cup, firmness) != ("averagecup", "averagefirmness"):
                    amounts.append((f"breast/{build}-{cup}-{firmness}", share * c * f))
    return amounts


def shaped(source: MakeHuman, shape: Shape) -> Vector:
    """Return all vertices (19158, 3) of a person as sculpted, arms half lowered."""
    vertices = source.base_m.copy()
    amounts = [(path, share) for path, share in _macros(shape) if share > 1e-6]
    for path, amount in shape.details.items():
        if "~" in path:
            amounts += [(path.replace("~", side), amount) for side in ("l", "r")]
        else:
            amounts.append((path, amount))
    for path, amount in amounts:
        target = source.target(path)
        vertices[target.vertices] += amount * target.delta_m
    return vertices

"""Something made of parts takes each field by its name, and nothing else."""

import inspect
from dataclasses import dataclass, field
from typing import Any

import pytest

from visavis.lab.parts import part_of, parts_from, takes_keywords_of


@dataclass(frozen=True, kw_only=True)
class Walls:
    height_m: float = 2.5
    colour: str = "white"


@dataclass(frozen=True, kw_only=True)
class Roof:
    pitch_deg: float = 30.0


PARTS = {"walls": Walls, "roof": Roof}


@dataclass(frozen=True)
class Keywords(Roof, Walls):
    name: str
    walls: Walls | None = field(default=None, kw_only=True)


class House:
    @takes_keywords_of(Keywords)
    def __init__(self, name: str, **keywords: Any) -> None:
        self.name = name
        made = parts_from(PARTS, keywords)
        self.walls, self.roof = made["walls"], made["roof"]


def test_a_keyword_goes_to_the_part_that_has_a_field_of_its_name() -> None:
    house = House("barn", pitch_deg=45.0, colour="red")
    assert (Walls(colour="red"), Roof(pitch_deg=45.0)) == (house.walls, house.roof)


def test_what_is_named_beside_a_whole_part_replaces_its_field() -> None:
    house = House("barn", walls=Walls(height_m=4.0, colour="red"), colour="green")
    assert Walls(height_m=4.0, colour="green") == house.walls


def test_another_keyword_is_refused_with_the_nearest() -> None:
    with pytest.raises(TypeError, match="keyword argument 'color'; did you mean 'colour'"):
        House("barn", color="red")  # type: ignore[call-arg]  # which is what is tested


def test_the_signature_shows_every_keyword() -> None:
    names = ["name", "height_m", "colour", "pitch_deg", "walls"]
    assert set(names) == set(inspect.signature(House).parameters)


def test_each_field_stands_in_one_part() -> None:
    expected = {"height_m": "walls", "colour": "walls", "pitch_deg": "roof"}
    assert expected == part_of(PARTS)

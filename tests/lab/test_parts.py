"""Something made of parts takes each field by its name, and nothing else."""

import inspect
from dataclasses import dataclass, field
from typing import Any

import pytest

from visavis import Factor, Study
from visavis.analysis.gaze.movements import parameters
from visavis.analysis.gaze.movements.parameters import MovementParameters
from visavis.analysis.statistics_report import outcome
from visavis.analysis.statistics_report.outcome import Question
from visavis.lab.parts import missing_attribute, part_of, parts_from, takes_keywords_of
from visavis.study import declaration


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
        whole = parts_from(PARTS, keywords)
        self.walls, self.roof = whole["walls"], whole["roof"]


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


def test_an_attribute_that_a_part_has_is_answered_with_the_part() -> None:
    house = House("barn")
    said = [str(missing_attribute(house, name, PARTS)) for name in ("colour", "door")]
    assert [
        "a House has its colour in a part: .walls.colour",
        "House has no attribute 'door'",
    ] == said


MADE_OF_PARTS = [
    (Study, {"name": "mood", "factors": (Factor("face", ("calm", "angry")),)}, declaration.PARTS),
    (Question, {"test": "t"}, outcome.PARTS),
    (MovementParameters, {}, parameters.PARTS),
]


@pytest.mark.parametrize(("kind", "keywords", "parts"), MADE_OF_PARTS)
def test_what_is_made_of_parts_takes_its_own_keywords_those_of_parts_and_parts_whole(
    kind: Any, keywords: dict[str, Any], parts: Any
) -> None:
    taken = set(inspect.signature(kind).parameters)
    whole = kind(**keywords)
    own = {name for name in vars(whole) if not name.startswith("_")}
    assert own | {*parts, *part_of(parts)} == taken
    for name, part in part_of(parts).items():
        with pytest.raises(AttributeError, match=rf"in a part: \.{part}\.{name}"):
            getattr(whole, name)

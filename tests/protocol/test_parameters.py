"""What somebody types for a study's parameters is taken as meant, or refused with what to type."""

import math
from dataclasses import dataclass
from typing import Any

import pytest

from visavis.lab.errors import ConfigError
from visavis.protocol.plan.parameters import Within, out_of_range, parameters_from


@dataclass(frozen=True)
class Settings:
    pause_s: float = 1.0
    repetitions: int = 2
    is_loud: bool = False
    pattern: str = "steady"


def read(**overrides: Any) -> Settings:
    return parameters_from(Settings, overrides, "demo")


def test_what_is_left_out_keeps_its_default() -> None:
    assert Settings() == read()
    assert Settings(pause_s=3.0, repetitions=4) == read(pause_s=3, repetitions=4.0)


@pytest.mark.parametrize(
    ("name", "value", "way_out"),
    [
        ("pause_s", "four", "give a number"),
        ("pause_s", None, "pause_s is empty: give a number"),
        ("pause_s", True, "give a number"),
        ("pause_s", math.nan, "give a finite number"),
        ("pause_s", math.inf, "give a finite number"),
        ("pause_s", [1.0], "give a number"),
        ("repetitions", 2.5, "give a whole number"),
        ("repetitions", True, "give a number"),
        ("is_loud", "maybe", "give yes or no"),
        ("is_loud", 1, "give yes or no"),
        ("pattern", 7, "give a name"),
        ("pattern", ["steady"], "give a name"),
    ],
)
def test_value_of_another_kind_is_refused_with_what_to_give(
    name: str, value: Any, way_out: str
) -> None:
    with pytest.raises(ConfigError, match=f"{name} is .*{way_out.split(': ')[-1]}"):
        read(**{name: value})


def test_every_problem_is_told_at_once_with_the_nearest_name() -> None:
    with pytest.raises(ConfigError) as refused:
        read(paus_s=1, pause_s="x", repetitions=math.nan)
    text = str(refused.value)
    assert "no paus_s (did you mean pause_s?)" in text
    assert "pause_s is 'x'" in text
    assert "repetitions is nan" in text
    assert "parameters: pause_s, repetitions, is_loud, pattern" in text


@pytest.mark.parametrize(
    ("allowed", "within", "outside"),
    [
        (Within(0, 2), (0, 1.5, 2), (math.nextafter(0, -1), math.nextafter(2, 3), math.nan)),
        (Within(0, 2, open=True), (0.1, 1.9), (0, 2, math.nan)),
        (Within(8), (8, 1e9), (7,)),
        (("front", "oriented"), ("front",), ("aside", "")),
    ],
)
def test_what_lies_within_is_taken_and_nothing_else(
    allowed: Any, within: tuple[Any, ...], outside: tuple[Any, ...]
) -> None:
    assert {""} == {out_of_range("increment", value, allowed) for value in within}
    for value in outside:
        assert "increment" in out_of_range("increment", value, allowed)


@pytest.mark.parametrize(
    ("value", "allowed", "said"),
    [
        (3, Within(0, 2), "increment is 3; give a number 0 to 2"),
        (0, Within(0, open=True), "increment is 0; give a number above 0"),
        (1, Within(0, 1, open=True), "increment is 1; give a number between 0 and 1"),
        (12, Within(high=11, why="seats"), "increment is 12; give a number up to 11 (seats)"),
        (["a", "x"], ("a", "b"), "no increment 'x'; choose among a, b"),
    ],
)
def test_what_lies_outside_is_refused_with_what_to_give(
    value: Any, allowed: Any, said: str
) -> None:
    assert said == out_of_range("increment", value, allowed)

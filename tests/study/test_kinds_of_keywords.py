"""What a study's keywords take, and what is said of a value of another kind."""

import inspect
import itertools
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, get_args

import numpy as np
import pytest

import visavis
from visavis import (
    Careless,
    Choice,
    Compare,
    Criterion,
    Factor,
    Keys,
    Lens,
    Measure,
    Pairs,
    Placed,
    Printed,
    Rating,
    Scene,
    Shape,
    SideBySide,
    Slider,
    Study,
    Text,
    Tone,
    Voice,
)
from visavis.analysis.statistics_report import TESTS
from visavis.lab.errors import DesignError
from visavis.lab.kinds import is_of_kind, words_of_kind
from visavis.study.actions import Action
from visavis.study.comparisons import Test
from visavis.study.declaration import PARTS
from visavis.study.heard_trial import HeardTrial
from visavis.study.scenes import Staging, stage
from visavis.study.trial import TrialScript


class Form(StrEnum):
    """A choice of a lab's own."""

    ROUND = "ellipse"


@dataclass(frozen=True)
class Longer(Rating):
    """A user's own kind of rating."""

    more: Annotated[int, "checked elsewhere"] | None = 3


HINTS = {f.name: f.type for part in PARTS.values() for f in fields(part)}
VALUES = ("x", 3, 1.5, None, True, [3], {"a": 3}, object())
FACTORS = [Factor("side", ["left", "right"])]
OTHERS = [
    (keyword, value)
    for keyword, value in itertools.product(HINTS, VALUES)
    if not is_of_kind(value, HINTS[keyword])
]

PARTS_OF_A_FILE = "Directed Dots Following Grating Lens LooksOn Returning Within".split()
"""Those that need no argument."""
SMALLEST: dict[str, dict[str, Any]] = {
    "Careless": {"response": "r"},
    "Choice": {"name": "c", "options": ["a", "b"]},
    "Compare": {"dv": "z", "within": "side"},
    "Confusion": {"shown": "s", "answered": "a"},
    "Correlate": {
        "family": "f",
        "measures": ["m"],
        "factor": "f",
        "score": "s",
        "score_words": "w",
        "score_name": "n",
    },
    "Criterion": {"of": "r"},
    "Exclusion": {"name": "n", "level": "trial", "column": "c", "limit": 1.0, "words": "w"},
    "Fact": {"kind": "design", "what": "w", "printed": "p", "where": "w"},
    "Factor": {"name": "f", "levels": ["a", "b"]},
    "Film": {"scene": Scene("person"), "seconds": 2.0},
    "FreeText": {"name": "t"},
    "Image": {"file": "a.png", "width_deg": 5.0},
    "Items": {"file": "a.csv"},
    "Keys": {"name": "k", "options": ["f", "j"]},
    "Measure": {"column": "c", "unit": "1", "words": "w"},
    "Near": {"weights": {"a": 1.0}},
    "Number": {"name": "n"},
    "Pairs": {"family": "f", "measures": ["m"], "factor": "f", "levels": [("a", "b")]},
    "Panorama": {"file": "a.png"},
    "Placed": {"places_m": [(0, 1, 0)]},
    "Pointing": {"name": "p"},
    "Printed": {"is_significant": True},
    "PrintedOrder": {"order": "a > b", "measure": "m", "where": "w"},
    "Psychometric": {"name": "p"},
    "QuestPlus": {"name": "q", "levels": [1.0, 2.0], "thresholds": [1.0, 2.0]},
    "Race": {"drift": {"a": 1.0, "b": 2.0}},
    "Rating": {"name": "r"},
    "Room": {"file": "a.glb"},
    "Shape": {"kind": "ellipse"},
    "SideBySide": {"name": "s", "left": "a", "right": "b"},
    "Slider": {"name": "s"},
    "Sound": {"file": "a.wav"},
    "Source": {"citation": "c"},
    "Staircase": {"name": "s", "start": 1.0, "step": 0.1},
    "Text": {"text": "t"},
    "Tone": {"frequency_hz": 440.0},
    "Video": {"file": "a.mp4", "width_deg": 5.0},
    "Voice": {"file": "a.wav"},
    "WhenGazeOn": {"option": "o", "area": "a"},
    "WhenNear": {"option": "o", "within_m": 1.0},
}
STEPS: dict[str, dict[str, Any]] = {
    "ask": {"response": Rating("nice")},
    "dark": {"seconds": 1.0},
    "end": {"reason": "r"},
    "key": {"response": Keys("space")},
    "mark": {"name": "m"},
    "mould": {"live": None, "sliders": [Slider("s")]},
    "play": {"sound": "a.wav"},
    "repeat": {"reason": "r"},
    "show": {"what": Text("t")},
    "vibrate": {"role": "armband_left"},
    "wait": {"seconds": 1.0},
    "walk_to": {"x_m": 1.0, "z_m": 1.0},
    "watch": {"stimulus": None},
}
"""Steps of a trial, with arguments that are of their kind."""
FUNCTIONS = (
    "blink_count blink_rate column detection dwell_on dwell_share_on first_fixation_on "
    "fixations_on gaze_on key_held looks_at motion_of never_next_to no_more_than pointer_at "
    "psychometric_measures staircase_measures transitions view_range"
).split()
ACCEPTED: list[tuple[Callable[[], Any], Any]] = [
    (lambda: Tone(440.0, ear=np.random.default_rng(1).choice(["left"])).ear, "left"),
    (lambda: Shape(Form.ROUND).kind, "ellipse"),
    (lambda: Text(3).text, "3"),
    (lambda: Text(np.array("a")).text, "a"),
    (lambda: Text("a", height_deg=np.where([True], 1.0, 2.0)[0]).height_deg, 1.0),
    (lambda: Text("a", height_deg=np.where(True, 1.0, 2.0)).height_deg, 1.0),
    (lambda: Text("a", at_deg=np.array([1, 2])).at_deg, (1.0, 2.0)),
    (lambda: Text("a", at_deg=range(2)).at_deg, (0.0, 1.0)),
    (lambda: Shape("ellipse", colour=np.array([255, 0, 0])).colour, (255, 0, 0)),
    (lambda: SideBySide("s", 1, 4).right, 4),
    (lambda: Choice("c", map(str, range(3))).options, ("0", "1", "2")),
    (lambda: Choice("c", [1, 2]).options, ("1", "2")),
    (lambda: Compare("z", within=(one for one in ("a", "b"))).within, ("a", "b")),
    (lambda: Factor("f", range(3)).levels, (0, 1, 2)),
    (lambda: Pairs("f", ["m"], "f", itertools.combinations("abc", 2)).levels[2], ("b", "c")),
    (lambda: Careless("r", checks={"a"}).checks, {"a"}),
    (lambda: Measure("c", "1", "w", areas=["a"]).areas, ["a"]),
    (lambda: Lens(np.zeros(3), np.ones(3)).aim_m, (1.0, 1.0, 1.0)),
    (lambda: Placed(np.zeros((1, 3))).places_m, ((0.0, 0.0, 0.0),)),
    (lambda: Voice(Path("a.wav")).file, Path("a.wav")),
    (lambda: Printed(is_significant=np.bool_(True)).is_significant, True),
    (lambda: Rating("r", np.int64(1), 7).low, 1),
    (lambda: Longer("r", more=None).more, None),
    (lambda: visavis.never_next_to("f", itertools.permutations("ab", 2)) is not None, True),
]
"""What is of another type than its annotation, and yet leaves no doubt."""
SEVERAL = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
OTHERWISE_MADE = (
    "Conclusion Live LiveFilm LiveScene MeasuredTrial Moulded Pair Pieces Scene Seen Staging Study "
    "TrialRecord Waveform"
).split()
"""What functions of the kit hand over or return, what has rules of its own, or needs files."""
LENIENT = {
    *(("Choice", name) for name in ("options", "labels", "means", "keys")),
    *(("SideBySide", name) for name in ("left", "right")),
    *(("Factor", name) for name in ("levels", "practice_only")),
    *(("QuestPlus", name) for name in ("slopes", "lapses")),
    ("Film", "scene"),
    ("Keys", "options"),
    ("Number", "unit"),
    ("Slider", "unit"),
    ("Text", "text"),
    ("show", "what"),
}
"""They take more than they hold, or say in words of their own what they do not take."""


def keywords_of(keyword: str, value: Any) -> dict[str, Any]:
    return {"factors": FACTORS, keyword: value}


@pytest.mark.parametrize(("keyword", "value"), OTHERS)
def test_a_value_of_another_kind_is_refused_by_the_keywords_name(keyword: str, value: Any) -> None:
    with pytest.raises(DesignError, match=f"study kinds: .*{keyword} (is|holds) .*"):
        Study("kinds", **keywords_of(keyword, value))


def test_most_values_are_of_another_kind() -> None:
    assert len(HINTS) * len(VALUES) / 2 < len(OTHERS)


@pytest.mark.parametrize(
    ("keyword", "value", "says"),
    [
        ("repetitions", 1.5, "repetitions is 1.5; it takes a whole number"),
        ("order", "sorted", "order is 'sorted'; it takes 'fixed', 'random', "),
        ("practice", [3], "practice holds 3; it takes a whole number or a list"),
        ("calibrate", "no", "calibrate is 'no'; it takes True or False"),
        ("check_of", 3, "check_of is 3; it takes a function"),
        ("questions", {"a": 3}, "questions holds 3 for 'a'; it takes a text for each name"),
        ("returning", 24, r"returning is 24; it takes Returning\(…\)"),
        ("xr", "often", "xr is 'often'; it takes 'never', 'optional' or 'required'"),
        ("days_between", (1, "x"), "days_between holds 'x'; it takes two numbers"),
        ("texts", {}, "texts is {}; it takes a text"),
        ("title", 3, "title is 3; it takes a text"),
        ("thresholds", 3, "thresholds is 3; it takes a dataclass of numbers"),
        ("base", "stare", "base is 'stare'; it takes a Study"),
        ("compare", None, "compare is None; it takes a list"),
    ],
)
def test_it_says_what_the_keyword_takes(keyword: str, value: Any, says: str) -> None:
    with pytest.raises(DesignError, match=says):
        Study("kinds", **keywords_of(keyword, value))


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ({"alpha": "x"}, "Compare 'z': alpha is 'x'; it takes a number"),
        ({"test": "paird"}, "test is 'paird'; did you mean 'paired'"),
        ({"correction": "hochberg"}, "it takes 'none', 'holm', 'bonferroni' or 'bh'"),
        ({"published": 3}, r"published is 3; it takes Printed\(…\)"),
        ({"within": {"side": 1}}, "within is .*; it takes a text or a list of texts"),
        ({"only": None}, "only is None; it takes names with what belongs to each"),
        ({"only": {"side": ("l", "r")}}, r"only holds \('l', 'r'\) for 'side'; it takes a text, "),
        ({"where": ["a > 1", None]}, "where holds None; it takes a text or a list of texts"),
        ({"claim": ["x"] * 99}, r"claim is \[.{59}…; it takes a text"),
        ({"exploratory": "yes"}, "exploratory is 'yes'; it takes True or False"),
    ],
)
def test_what_stands_in_a_keywords_list_is_looked_at_before_anybody_comes(
    value: Any, says: str
) -> None:
    with pytest.raises(DesignError, match=says):
        Study("kinds", **keywords_of("compare", [Compare("z", **{"within": "side", **value})]))


@pytest.mark.parametrize("name", [*PARTS_OF_A_FILE, *SMALLEST])
def test_what_a_study_file_makes_is_refused_by_the_name_of_what_is_of_another_kind(
    name: str,
) -> None:
    maker, smallest = getattr(visavis, name), SMALLEST.get(name, {})
    maker(**smallest)
    for field in (f for f in fields(maker) if f.init and (name, f.name) not in LENIENT):
        for value in VALUES:
            if not is_of_kind(value, field.type):
                with pytest.raises(DesignError, match=f"{name}.*: {field.name} (is|holds) "):
                    maker(**{**smallest, field.name: value})


def test_every_dataclass_that_a_study_file_makes_looks_at_kinds() -> None:
    classes = (getattr(visavis, name) for name in visavis.__all__)
    dataclasses = {c.__name__ for c in classes if isinstance(c, type) and is_dataclass(c)}
    assert {*PARTS_OF_A_FILE, *SMALLEST, *OTHERWISE_MADE} == dataclasses


@pytest.mark.parametrize(("make", "expected"), ACCEPTED)
def test_what_can_be_meant_but_one_way_is_accepted(make: Callable[[], Any], expected: Any) -> None:
    assert expected == make()


@pytest.mark.parametrize("name", STEPS)
def test_a_step_of_a_trial_is_refused_before_anybody_comes(name: str) -> None:
    step, smallest = getattr(TrialScript, name), STEPS[name]
    for argument, parameter in inspect.signature(step).parameters.items():
        if argument == "self" or (name, argument) in LENIENT or parameter.kind in SEVERAL:
            continue
        for value in VALUES:
            if not is_of_kind(value, parameter.annotation):
                with pytest.raises(DesignError, match=rf"t\.{name}: {argument} (is|holds) "):
                    step(None, **{**smallest, argument: value})


def test_every_step_of_a_trial_looks_at_kinds() -> None:
    steps = {name for name, one in vars(TrialScript).items() if inspect.isfunction(one)}
    steps |= {name for name, one in vars(HeardTrial).items() if inspect.isfunction(one)}
    assert {
        name
        for name in steps
        if inspect.signature(getattr(TrialScript, name)).return_annotation is Action
        and len(inspect.signature(getattr(TrialScript, name)).parameters) > 1
    } == set(STEPS)


def test_every_function_of_a_study_file_is_among_those_that_look_at_kinds() -> None:
    everything = {name for name in visavis.__all__ if inspect.isfunction(getattr(visavis, name))}
    assert {*FUNCTIONS, "derive", "neutral_answer"} == everything  # one takes any keyword


@pytest.mark.parametrize("function", FUNCTIONS)
def test_functions_of_a_study_file_look_at_kinds(function: str) -> None:
    measure_of = getattr(visavis, function)
    name, parameter = next(iter(inspect.signature(measure_of).parameters.items()))
    of_several = r"\[0\]" if parameter.kind in SEVERAL else ""
    smallest = {
        one: None
        for one, other in inspect.signature(measure_of).parameters.items()
        if other.default is inspect.Parameter.empty and one != name and other.kind not in SEVERAL
    }
    with pytest.raises(DesignError, match=f"^{function}: {name}{of_several} is <object "):
        measure_of(object(), **smallest)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"name": 3}, "Scene: name is 3; it takes a text"),
        ({"name": "person", "motion": 3}, "scene person: motion is 3; it takes a text"),
        ({"name": "person", "distance_m": "far"}, "distance_m is 'far'; it takes a number"),
        ({"name": "person", "motion": "walk", "speed_mps": "x"}, "Walk: speed_mps is 'x'; it "),
        ({"name": "two_people", "left": None}, "scene two_people: left is None; it takes a text"),
        ({"name": "audience", "active": 1}, "scene audience: active is 1; it takes a text"),
    ],
)
def test_options_of_a_scene_are_of_their_kind(options: dict[str, Any], says: str) -> None:
    with pytest.raises(DesignError, match=says):
        stage(Scene(**options), Staging(np.random.default_rng(1), 2.0), {})


@pytest.mark.parametrize("levels", ["left", {"left": 1}, None, 3])
def test_levels_of_a_factor_are_a_list_and_no_letters(levels: Any) -> None:
    with pytest.raises(DesignError, match=r"Factor 'side': levels is .*it takes a list"):
        Factor("side", levels)


def test_every_test_of_the_statistics_can_be_named() -> None:
    assert {"", *TESTS} == set(get_args(Test))


@pytest.mark.parametrize(
    ("value", "hint", "expected"),
    [
        (Criterion("answer_is_right"), Criterion | None, True),
        (None, Criterion | None, True),
        (True, int, False),
        (3, float, True),
        ("read", HINTS["instructions"], True),
        ((6, 8), HINTS["days_between"], True),
        ({"a": 3}, HINTS["questions"], False),
        (frozenset({"card"}), HINTS["screening"], True),
    ],
)
def test_kinds(value: object, hint: Any, expected: bool) -> None:
    assert expected is is_of_kind(value, hint)
    assert words_of_kind(hint)

"""Walks moulded after a target: do four adjectives, or four features, lead there sooner than
27 weights?

After the second study of a paper on motion interpolation by adjectives. A green figure walks as the
target does. People first guess with each of three sets of sliders without seeing what they make of
the blue figure, then adjust each until it walks alike or the time is over.
"""

from collections.abc import Generator
from pathlib import Path
from typing import Any, Final

from visavis.experiments.adjectives.study import CITATION
from visavis.experiments.matching.facts import FACTS, ORDERS
from visavis.experiments.matching.interfaces import (
    INTERFACES,
    MIDDLE,
    PLACES,
    TARGETS,
    live_of,
    near,
    slider_names,
)
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import Factor
from visavis.protocol.plan.parameters import Within
from visavis.stimuli.motion.synthesis.pose_distance import MATCH_M
from visavis.study.actions import Action
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.live import Moulded, Slider
from visavis.study.measures import Measure
from visavis.study.source import Source
from visavis.study.trial import TrialScript

PHASES: Final = ("guess", "adjust")
LIMIT_S: Final = 300.0
PRACTICE: Final = tuple(
    {"target": f"practice_{interface}", "phase": phase, "interface": interface}
    for interface in INTERFACES
    for phase in PHASES
)
"""One target with each interface."""

study = Study(
    "matching",
    "Walks moulded after a target",
    "Do four adjectives or four features lead to a walk sooner than the weights of 27 walks?",
    factors=[
        Factor("target", TARGETS, practice_only=[n for n in PLACES if n not in TARGETS]),
        Factor("phase", PHASES),
        Factor("interface", INTERFACES),
    ],
    practice=PRACTICE,
    order="williams",
    blocked_by="target",
    block_order="williams",
    phased_by="phase",
    parameters={"within_m": MATCH_M, "limit_s": LIMIT_S, "start": MIDDLE},
    ranges={
        "within_m": Within(0.005, 0.5),
        "limit_s": Within(5.0, 3600.0),
        "start": Within(0.0, 1.0),
    },
    cells=("interface",),
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    exclusions=COMPLETENESS_RULES,
    columns=[
        Column("guess_m", "m", "mean distance of joints from the target after the blind guess"),
        Column("is_guessed", "1", "whether the blind guess was a match already"),
        Column(
            "time_s",
            "s",
            "time of adjusting until the match: 0 where the guess was one, the limit where there "
            "was none",
        ),
        Column("is_matched", "1", "whether there was a match before the limit"),
        Column("distance_m", "m", "mean distance of joints from the target after adjusting"),
    ],
    measures=[
        Measure("guess_m", "m", "Distance from the target after the guess"),
        Measure("is_guessed", "1", "Targets matched by the guess", aggregate="share"),
        Measure("time_s", "s", "Time until the match, or the limit"),
        Measure("is_matched", "1", "Targets matched before the limit", aggregate="share"),
        Measure("distance_m", "m", "Distance from the target after adjusting"),
    ],
    compare=[
        Compare(
            "guess_m",
            within="interface",
            only={"phase": "guess"},
            claim="A blind guess by four adjectives or features is nearer than one by weights",
            expects="weights > adjectives, features",
        ),
        Compare(
            "time_s",
            within="interface",
            only={"phase": "adjust"},
            claim="Adjusting four adjectives or features takes less time than adjusting weights",
            expects="weights > adjectives, features",
        ),
    ],
    primary=("guess_m:interface", "time_s:interface"),
    sections=["visavis.experiments.matching.sections:as_printed"],
    methods=(
        "Five target walks were blended of 27 (nine emotions at three speeds) by random adjectives "
        "and stayed the same for everybody. A figure in green walked as the target did. For each "
        "target participants set the sliders of three interfaces without seeing what they make: "
        "four adjectives, four groups of motion features, and the weights of the 27 walks. Then "
        "they saw the figure in blue, too, and adjusted each of the interfaces from where their "
        "guess had left it until the mean distance of 20 joints over ten moments of the cycle was "
        "below {within_m} m, or for {limit_s} s. Orders of targets and of interfaces were "
        "balanced over participants (Williams)."
    ),
    source=Source(CITATION, participants=13, where="section 6.1", facts=FACTS, orders=ORDERS),
    references=(CITATION,),
)


@study.trial
def trial(t: TrialScript) -> Generator[Action, Any, None]:
    """Guess with sliders whose figure is not seen, or adjust them from there until it matches."""
    live, guesses = live_of(t.interface), t.session_memory
    own = f"{t.target} by {t.interface}"
    guess: Moulded | None = guesses.get(own)
    starts = {} if guess is None else guess.values
    sliders = [Slider(n, start=starts.get(n, t.start)) for n in slider_names(t.interface)]
    goal, caption = near(t.target, t.within_m), t.text(f"captions.{t.phase}")
    if t.phase == "guess":
        mould = yield t.mould(
            live, sliders, until=goal, limit_s=t.limit_s, caption=caption, is_blind=True
        )
        guesses[own] = mould
        t.row |= {"guess_m": mould.distance_m, "is_guessed": _is_match(mould, t.within_m)}
        return
    if guess is not None and _is_match(guess, t.within_m):
        yield t.wait(0.0)  # there is nothing to adjust, as in the source
        t.row |= {"time_s": 0.0, "is_matched": True, "distance_m": guess.distance_m}
        return
    mould = yield t.mould(live, sliders, until=goal, limit_s=t.limit_s, caption=caption)
    is_matched = mould.ended_by == "near"
    t.row |= {
        "time_s": mould.seconds if is_matched else t.limit_s,
        "is_matched": is_matched,
        "distance_m": mould.distance_m,
    }


def _is_match(made: Moulded, within_m: float) -> bool:
    return made.distance_m is not None and made.distance_m < within_m

"""Which camera films a walk best: by the place's own tracks, behind, scattered, or placed by hand?

After chapter 5 of Jovane's thesis, which shows no films to anybody: three walks through a gallery,
each filmed by four cameras, all pairs of cameras beside each other.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.experiments.cameras.facts import FACTS
from visavis.experiments.cameras.walks import DOES_S, ROOM, WALKS, everybody, timed_walk
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.design import Factor
from visavis.protocol.plan.parameters import Within
from visavis.stimuli.motion.kinds import Idle, Walk
from visavis.stimuli.scenes.gathering import GatheringScene
from visavis.study.actions import Action
from visavis.study.asking import Answer
from visavis.study.comparisons import Compare
from visavis.study.declaration import Study
from visavis.study.exclusions import COMPLETENESS_RULES
from visavis.study.films import Directed, Film, Following, Moving, Pair, Placed
from visavis.study.measures import column
from visavis.study.moving_camera import FilmSeen
from visavis.study.responses import Choice, Response
from visavis.study.scenes import Scene, StagedScene, Staging, scene_of_people
from visavis.study.source import Source
from visavis.study.study_functions import Seen
from visavis.study.trial import TrialScript

CITATION: Final = (
    "Jovane, A. (2023): Modeling of reactive movement and non-verbal behaviors for the creation of "
    "digital agents for virtual reality. Thesis, Université de Rennes, chapter 5; first as Jovane, "
    "Louarn and Christie (2020): Topology-aware camera control for real-time applications. Motion, "
    "Interaction and Games."
)
CAMERAS: Final[Mapping[str, Moving]] = {
    "topology": Directed("tracks"),
    "follow": Following(),
    "roadmap": Directed("scattered"),
    "placed": Placed(
        ((-6.6, 2.6, 4.6), (6.6, 2.6, 4.6), (6.6, 2.6, -4.6), (-6.6, 2.6, -4.6), (1.5, 2.6, -4.7))
    ),
}
"""Cameras: the director on tracks, over the shoulder, the director between scattered places, and
five cameras under the ceiling that take turns.
"""
PAIRS: Final = tuple(f"{a}|{b}" for i, a in enumerate(CAMERAS) for b in tuple(CAMERAS)[i + 1 :])
VOTES: Final = ("left_much", "left_some", "equal", "right_some", "right_much")
MEANINGS: Final = ("first_much", "first_some", "equal", "second_some", "second_much")
"""What the votes mean where the film of the pair's first camera stands left."""
SAW: Final = ("left", "right", "both", "neither")
SIZE_PX: Final = (640, 360)
RATE_HZ: Final = 30

# The simulated viewer, not fitted to people: what a film loses on the scale of votes, where 1
# separates "slightly" from "much".
LOSS_UNSEEN: Final = 3.0
"""For a whole film in which the walker cannot be seen."""
JERK: Final = 0.35
"""For ten times the jerk."""
CUTS: Final = 0.04
"""For every cut in a minute."""
SIZE: Final = 0.5
"""For a walker of half or twice the size that the shot asks for."""
PERSON_SD: Final = 0.3
ERROR_SD: Final = 0.8
READABLE_01: Final = 0.2
"""Height share of the picture that somebody must fill for their action to be recognised."""
SLIPS_01: Final = 0.05

study = Study(
    "cameras",
    "Four cameras and the same walk",
    "Is a walk filmed better by a camera that knows the place than by others?",
    factors=[Factor("walk", tuple(WALKS)), Factor("pair", PAIRS)],
    order="random",
    cells=("pair",),
    parameters={"same_within": 0.5},
    ranges={"same_within": Within(0.05, 2.0)},
    texts="texts",
    folder=Path(__file__).parent,
    on="browser",
    uses=(),
    calibrate=False,
    validate=False,
    questionnaires=("about_viewers",),
    exclusions=COMPLETENESS_RULES,
    measures=[
        column(
            "preference",
            "1",
            "vote for the pair's first camera: 2 much, 1 slightly better, 0 equal, negative for "
            "the second",
        ),
        column(
            "understood",
            "1",
            "in whose film alone could be seen what was done on the way: 1 the first camera's, "
            "-1 the second's, 0 in both or neither",
        ),
    ],
    columns=[
        Column(
            "first_side",
            "",
            "where the film of the pair's first camera stood",
            {"left": "on the left", "right": "on the right"},
        ),
        Column("saw_first", "", "what was done could be seen in the first camera's film"),
        Column("saw_second", "", "the same in the second's"),
    ],
    compare=[
        Compare(
            "preference",
            within="pair",
            model="bradleyterry",
            claim="viewers prefer the films of a camera that knows the place to all others",
            expects="topology > follow, roadmap, placed",
        ),
        Compare(
            "understood",
            within="pair",
            model="bradleyterry",
            family="comprehension",
            claim="what somebody does is easier to see in films of a camera that knows the place",
            expects="topology > follow, roadmap, placed",
        ),
    ],
    primary=("preference:pair",),
    sections=["visavis.experiments.cameras.sections:cameras"],
    methods=(
        "The same walk was filmed by four cameras and any two of the films ran beside each other, "
        "begun together: by a director on tracks found from the room's topology, by a camera that "
        "followed over the right shoulder, by the same director between places scattered at random "
        "(1.5 a square metre, links up to 5 m), by five cameras placed by hand that took turns. "
        "All films were long shots with 40° from top to bottom, 640 × 360 pixels at 30 pictures a "
        "second. Which film stood left was drawn for each trial."
    ),
    source=Source(CITATION, facts=FACTS),
    references=(CITATION,),
)


@study.scene("walk")
def walk(staging: Staging, *, walk: str) -> StagedScene:
    """Return somebody who walks through the gallery and does something on the way."""
    return scene_of_people(staging, "walk", everybody(walk), "walker", "averted", room_by=ROOM)


@study.trial
def trial(t: TrialScript) -> Iterator[Action]:
    """Show two films of a walk; have one preferred, and ask where what was done could be seen."""
    cameras, scene = str(t.pair).split("|"), Scene("walk", walk=t.walk)
    first, second = (
        Film(scene, timed_walk(t.walk).seconds, SIZE_PX, RATE_HZ, lens=CAMERAS[c]) for c in cameras
    )
    is_left = bool(t.rng().integers(2))
    pair = Pair(first, second) if is_left else Pair(second, first)
    answers: Any = yield t.watch(pair, *questions(is_left))
    vote: Answer = answers["vote"]
    saw: Answer = answers["saw"]
    sign = -1 if is_left else 1
    t.row["first_side"] = "left" if is_left else "right"
    t.row["preference"] = None if vote.option is None else sign * (VOTES.index(vote.option) - 2)
    own, other = ("left", "right") if is_left else ("right", "left")
    in_first = None if saw.option is None else saw.option in (own, "both")
    in_second = None if saw.option is None else saw.option in (other, "both")
    t.row["saw_first"], t.row["saw_second"] = in_first, in_second
    both_known = in_first is not None and in_second is not None
    t.row["understood"] = int(bool(in_first)) - int(bool(in_second)) if both_known else None


def questions(is_left: bool) -> tuple[Choice, Choice]:
    """Return both questions of a trial in which the pair's first film stands left or right."""
    first, second = ("left", "right") if is_left else ("right", "left")
    shown = {first: "first", second: "second"}
    return (
        Choice("vote", VOTES, means=MEANINGS if is_left else MEANINGS[::-1]),
        Choice("saw", SAW, means=[shown.get(side, side) for side in SAW]),
    )


@study.answer
def answer(seen: Seen, response: Response, rng: np.random.Generator) -> str:
    """Vote by what the films show; somebody blind to that votes by chance."""
    left, right = seen.films.get("left"), seen.films.get("right")
    shows = seen.effect and left is not None and right is not None
    if response.name == "saw":
        if not shows:
            return SAW[int(rng.integers(len(SAW)))]
        window_s = done_s(seen)
        could_see = [
            could_tell(film, window_s) != (rng.random() < SLIPS_01)
            for film in (left, right)
            if film is not None
        ]
        return {(True, False): "left", (False, True): "right", (True, True): "both"}.get(
            (could_see[0], could_see[1]), "neither"
        )
    better = faults(left) - faults(right) if left is not None and right is not None and shows else 0
    opinion = better + PERSON_SD * seen.leaning + ERROR_SD * rng.standard_normal()
    return VOTES[int(np.clip(round(opinion), -2, 2)) + 2]


def faults(film: FilmSeen) -> float:
    """Return what a film loses: time without its subject, jerk, cuts, a wrong size."""
    sheet = film.sheet
    cuts_per_min = 60.0 * (sheet.shots - 1) / sheet.seconds
    return (
        LOSS_UNSEEN * (1.0 - float(film.is_visible.mean()))
        + JERK * float(np.log10(1.0 + (sheet.jerk_mps3 or 0.0)))
        + CUTS * cuts_per_min
        + SIZE * float(np.log2(sheet.size_off_by or 1.0))
    )


def could_tell(film: FilmSeen, window_s: tuple[float, float]) -> bool:
    """Tell whether what is done in a time can be seen for half of it, large enough."""
    then = (film.t_s >= window_s[0]) & (film.t_s < window_s[1])
    clear = film.is_visible & (film.height_01 >= READABLE_01)
    return bool(clear[then].mean() >= 0.5) if then.any() else False


def done_s(seen: Seen) -> tuple[float, float]:
    """Return start and end of the time in which the walker does more than walk or stand."""
    scene = None if seen.last is None else seen.last.scene
    plan = scene.people[0].does if isinstance(scene, GatheringScene) else ()
    for doing in plan if isinstance(plan, tuple) else ():
        if not isinstance(doing.kind, Walk | Idle):
            return doing.start_s, doing.start_s + DOES_S
    return 0.0, 0.0

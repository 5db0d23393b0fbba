"""What the source of the hybrid study says of its design and tests, and in which order bars stand.

The source prints bars without figures; its text says in which order they stand.
"""

from collections.abc import Mapping
from typing import Final

from visavis.experiments.hybrid.clips import PLAYED_HZ
from visavis.protocol.plan.steps import Scalar
from visavis.stimuli.motion.synthesis.hybrid import pose_counts
from visavis.study.source import Fact, PrintedOrder

ANSWERS: Final[Mapping[str, int]] = {
    "clip_much": -2,
    "clip_some": -1,
    "equal": 0,
    "hybrid_some": 1,
    "hybrid_much": 2,
}
"""Votes by what they mean, as `preference` keeps them."""
POSITIVE: Final = {name: vote for name, vote in ANSWERS.items() if name != "clip_much"}
"""The votes that the source counts as positive."""
FIGURE_1, FIGURE_2, GROUPED = "figure 4.1", "figure 4.2", "figures 4.3 and 4.4"
_CLIP: Final = "clip_much, clip_some"


def _poses(increment: int) -> str:
    """Return how many poses are taken for an increment, of gaits and of the other motions."""
    gait, other = (pose_counts(name, increment).authored for name in ("walk", "idle"))
    return f"{gait} and {other}"


FACTS: Final = (
    Fact("design", "clips", 4, "section 3.3", of="clip"),
    Fact("design", "poses of gaits and others", "2 and 2", "section 3.2.7", here=_poses(0)),
    Fact(
        "design",
        "poses of gaits and others with increment 1",
        "4 and 3",
        "section 3.2.7, figure 4.2",
        here=_poses(1),
    ),
    Fact("design", "increments shown", 2, "section 3.3", of="increment"),
    Fact(
        "design",
        "increment 2",
        "made, not shown: it looked like increment 1",
        "section 3.3",
    ),
    Fact("design", "sides of the hybrid", 2, "section 3.3", of="hybrid_side"),
    Fact("design", "comparisons", 16, "section 3.3", of="trials"),
    Fact("design", "order", "random", "section 3.3", of="order"),
    Fact(
        "design",
        "clips",
        "captured: walk 30 frames, run with a limp, crouch 58 frames, idle",
        "sections 3.2.6 and 5.2 to 5.5",
        f"computed motions of ours, played at {PLAYED_HZ:g} frames a second, with the source's "
        "flaws as parameters (limp {limp}, excess_hips {excess_hips})",
        because="the source's clips are not to be had",
    ),
    Fact(
        "design",
        "walk and run",
        "two poses and their mirror images, Squad whose inner points are the neighbours",
        "sections 3.2.3 and 3.2.4",
        "two poses and their mirror images, Squad whose inner points are the {controls}",
    ),
    Fact("design", "idle", "two poses to and fro by Squad", "section 3.2.6"),
    Fact(
        "design",
        "crouch",
        "two poses, Slerp by a damped spring (ζ 0.7, ω 10, time × 0.7); then in reverse",
        "sections 3.2.5 and 3.2.7",
    ),
    Fact(
        "design",
        "clip of the crouch",
        "steps back before it goes down",
        "section 5.4",
        "crouches on the spot",
        because="our motions know no crouch with a step",
    ),
    Fact(
        "design",
        "character and camera",
        "a game engine's, no floor",
        "section 3.3",
        "one of Visavis' own cast, turned by 40°, on a floor",
        because="only models that may be passed on come with Visavis, and steps show from the side",
    ),
    Fact(
        "procedure",
        "where it runs",
        "a program of a game engine, sent to invited students",
        "section 3.3",
        "a page in a browser",
        because="nothing has to be installed, and what is kept can be said before",
    ),
    Fact("procedure", "options", 5, "section 3.3", of="vote"),
    Fact(
        "procedure",
        "criterion",
        "one's own; realism is not asked for",
        "section 3.3",
    ),
    Fact("procedure", "both figures", "begin together", "section 3.3"),
    Fact(
        "procedure",
        "when an answer counts",
        "at any time",
        "section 3.3",
        "after one whole round",
        because="somebody who has not seen the whole motion cannot judge it",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "questions about oneself",
        "a gamer? tech-savvy?",
        "section 3.3",
        "plays computer games regularly, is at home with technology",
        because="reworded: the source's exact questions are not printed",
    ),
    Fact(
        "measure",
        "votes",
        "counts of each option",
        "figures 4.1 and 4.2",
        "counts of each option, and the mean vote for the hybrid",
        because="one number of each comparison can be tested",
        is_stronger=True,
    ),
    Fact(
        "measure",
        "positive votes",
        "all but “clip significantly better”",
        "figures 4.3 and 4.4",
    ),
    Fact(
        "test",
        "tests",
        "none",
        "section 4.1",
        "equivalence within half a step, aligned ranks, mixed model, sign tests",
        because="bars alone do not say what is chance",
        is_stronger=True,
    ),
    Fact(
        "test",
        "performance of both techniques",
        "pictures a second for 1 to 200 figures",
        "section 4.2",
        "not repeated",
        because="it measured an engine's implementation, not what people see",
    ),
)


def _votes(order: str, clip: str, increment: int, words: str) -> PrintedOrder:
    """Return an order of the votes for one pair."""
    where = FIGURE_2 if increment else FIGURE_1
    cell: dict[str, Scalar] = {"clip": clip, "increment": increment}
    return PrintedOrder(order, "preference", where, answers=ANSWERS, only=cell, words=words)


def _shares(
    order: str,
    names: tuple[str, ...],
    clip: str,
    words: str,
    where: str = FIGURE_2,
    why_not: str = "",
) -> PrintedOrder:
    """Return an order of the share of some votes between the increments of a clip."""
    answers = {name: ANSWERS[name] for name in names}
    return PrintedOrder(
        order,
        "preference",
        where,
        factor="increment",
        answers=answers,
        only={"clip": clip},
        words=words,
        not_reproduced=why_not,
    )


_NO_SPREAD: Final = (
    "our walk with a pose more is worse for nearly all raters, where the source's divided its own"
)
_NO_CLIP: Final = (
    "the limp of our clip costs it every vote; how bad the source's looked is not printed"
)


def _most(name: str, but: str = "") -> str:
    """Return that one answer is given more often than all others, but for one."""
    return f"{name} > {', '.join(n for n in ANSWERS if n not in (name, but))}"


ORDERS: Final = (
    _votes(_most("clip_some"), "walk", 0, "walk, two poses: slightly for the clip most often"),
    _votes(_most("equal", "clip_some"), "walk", 0, "walk, two poses: equal comes next"),
    _votes(_most("hybrid_some"), "run", 0, "run, two poses: slightly for the hybrid most often"),
    PrintedOrder(
        "run > 0 > walk, crouch, idle",
        "preference",
        FIGURE_1,
        factor="clip",
        only={"increment": 0},
        words="two poses: only the hybrid of the run is preferred",
    ),
    PrintedOrder(
        "run > 0 > walk, crouch, idle",
        "preference",
        FIGURE_2,
        factor="clip",
        only={"increment": 1},
        words="a pose more: only the hybrid of the run is preferred",
    ),
    *(
        _votes(
            f"{_CLIP} > equal, hybrid_some, hybrid_much",
            clip,
            0,
            f"{clip}, two poses: for the clip, slightly and significantly",
        )
        for clip in ("crouch", "idle")
    ),
    _votes(_most("clip_some"), "walk", 1, "walk, a pose more: slightly for the clip most often"),
    _votes(_most("equal", "clip_some"), "walk", 1, "walk, a pose more: equal comes next"),
    _votes(_most("hybrid_some"), "run", 1, "run, a pose more: slightly for the hybrid most often"),
    _votes(
        f"{_CLIP} > equal, hybrid_some, hybrid_much",
        "crouch",
        1,
        "crouch, a pose more: slightly and significantly for the clip most often",
    ),
    _votes(_most("clip_much"), "idle", 1, "idle, a pose more: mostly significantly for the clip"),
    _shares(
        "1 > 0",
        ("equal",),
        "walk",
        "walk: more equal votes with a pose more",
        why_not=_NO_SPREAD,
    ),
    _shares("1 > 0", ("clip_much",), "walk", "walk: more significantly for the clip"),
    _shares(
        "0 > 1",
        ("clip_some",),
        "walk",
        "walk: fewer slightly for the clip",
        why_not=_NO_SPREAD,
    ),
    _shares(
        "1 > 0",
        ("clip_much",),
        "run",
        "run: more significantly for the clip",
        why_not=_NO_CLIP,
    ),
    _shares("1 > 0", ("hybrid_much",), "run", "run: more significantly for the hybrid"),
    _shares("0 > 1", ("clip_much",), "crouch", "crouch: fewer significantly for the clip"),
    _shares("1 > 0", ("clip_some",), "crouch", "crouch: more slightly for the clip"),
    _shares(
        "1 > 0",
        ("hybrid_some",),
        "crouch",
        "crouch: more slightly for the hybrid",
        why_not="our clip crouches on the spot, so that nothing but sliding and sinking feet tell "
        "the two apart",
    ),
    _shares("1 > 0", ("clip_much",), "idle", "idle: more significantly for the clip"),
    *(
        _shares(
            order,
            tuple(POSITIVE),
            clip,
            f"{clip}: share of positive votes {what}",
            GROUPED,
            _NO_CLIP if clip == "run" else "",
        )
        for clip, order, what in (
            ("walk", "0 > 1", "falls"),
            ("run", "0 > 1", "falls"),
            ("crouch", "1 > 0", "rises"),
            ("idle", "0 > 1", "falls"),
        )
    ),
    *(
        PrintedOrder(
            "walk, run > 0.5",
            "preference",
            GROUPED,
            factor="clip",
            answers=POSITIVE,
            only={"increment": k},
            words=f"walk and run, {what}: most votes are positive",
        )
        for k, what in enumerate(("two poses", "a pose more"))
    ),
)
"""What the source says of its bars; the increments are 0 and 1, an order's words say which."""

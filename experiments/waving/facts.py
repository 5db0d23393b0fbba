"""What the source of the waving study says about its design, procedure, measures and tests."""

from typing import Final

from visavis.experiments.waving.clips import PLACES, UNITS
from visavis.stimuli.scenes.office import CLERKS
from visavis.study.source import Fact, PrintedOrder

FACTS: Final = (
    Fact("design", "techniques", 2, "section 2.3.1", of="technique"),
    Fact("design", "directions", 3, "section 2.3.1", of="direction"),
    Fact("design", "trials", 54, "section 2.3.1", of="trials"),
    Fact("design", "training trials", 2, "section 2.3.1", of="practice"),
    Fact("design", "order of trials", "random", "section 2.3.1", of="order"),
    Fact(
        "design",
        "repetitions of a technique and direction",
        9,
        "section 2.3.1",
        here=len(CLERKS) * 3,
    ),
    Fact(
        "design",
        "what differs between the nine repetitions",
        "not said",
        "section 2.3.1",
        "three clerks × three own places",
        because="all nine combinations of what the source describes",
    ),
    Fact("design", "customers in line", 5, "figure 2.7", here=len(PLACES)),
    Fact("design", "own places", 3, "figure 2.7", of="participant_place"),
    Fact("design", "clerks", 3, "figure 2.7", of="clerk"),
    Fact(
        "design",
        "office",
        "a sketch; what hides clerks grows towards the right",
        "figure 2.7, section 2.3.4",
        "measures and furniture of ours, more hidden on the right",
        because="only a sketch is printed",
    ),
    Fact(
        "procedure",
        "orientation",
        "the whole body is turned to the addressee",
        "section 2.3.1",
    ),
    Fact(
        "procedure",
        "warping",
        "more coverage of head and waving hand, by all units that move them",
        "section 2.3.1",
        f"more coverage of face and waving hand, by {', '.join(UNITS).replace('_', ' ')}",
        because="a head in profile covers more pixels than one that faces the addressee",
    ),
    Fact(
        "procedure",
        "how much more coverage",
        "not said",
        "section 2.3.1",
        "{increment} more, reached in about a third of frames; the report says how often it was "
        "and could be",
        because="a number has to be chosen, and most waves cannot come to more",
    ),
    Fact(
        "procedure",
        "what warping begins from",
        "not said",
        "section 2.3.1",
        "the wave straight ahead, as captured (`warp_from`)",
        because="a wave that is turned already has nothing to win",
    ),
    Fact(
        "procedure",
        "loop of warping",
        "3 to 5 Hz, for every wave",
        "section 2.2.3",
        "up to 30 Hz from a plan for waves at the participant; others as planned",
        because="virtual customers stand still, and a slower loop lags behind heads",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "eyes of the clerk",
        "led to the addressee by the same controller with both techniques",
        "section 2.3.1",
    ),
    Fact(
        "procedure",
        "headset",
        "HTC Vive, headphones and two controllers",
        "section 2.3.1",
        "any headset that Visavis drives, no headphones; answers by ray, keys or aloud",
        because="what was heard is not said, and labs have other devices",
    ),
    Fact("procedure", "posture", "standing", "section 2.3.1", of="posture"),
    Fact(
        "procedure",
        "breaks",
        "between any two trials",
        "section 2.3.1",
        "between any two trials, and after each of {blocks} parts",
    ),
    Fact("procedure", "answers to the question to whom", 5, "section 2.3.1", of="who"),
    Fact("procedure", "realism", "1 to 9", "section 2.3.1", of="realism"),
    Fact(
        "procedure",
        "after the session",
        "demographics, strategy, comment",
        "section 2.3.1",
    ),
    Fact(
        "measure",
        "accuracy and realism",
        "share of right answers, mean rating, by technique and direction",
        "section 2.3.2",
    ),
    Fact(
        "measure",
        "response time",
        "not measured",
        "",
        "median from the frame that showed the question, explored",
        because="it costs nothing and tells doubt",
        is_stronger=True,
    ),
    Fact(
        "test",
        "test",
        "two-way repeated-measures ART ANOVA, Tukey contrasts, .05",
        "section 2.3.2",
    ),
    Fact(
        "test",
        "who is left out",
        "not said",
        "",
        "trials without an answer, people with too few trials or without a cell",
        because="a rule has to stand before data are looked at",
        is_stronger=True,
    ),
)
ORDERS: Final = (
    PrintedOrder(
        "warping > orientation",
        "is_right",
        "section 2.3.3, figure 2.10",
        factor="technique",
        only={"direction": "self"},
    ),
    PrintedOrder(
        "warping > orientation",
        "is_right",
        "section 2.3.3, figure 2.10",
        factor="technique",
        only={"direction": "right"},
    ),
)
"""Tendencies that are printed beside the results."""

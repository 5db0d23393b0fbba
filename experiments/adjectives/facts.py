"""What the source of the adjectives study says about its design, procedure and measures."""

from typing import Final

from visavis.experiments.adjectives.pairs import PAIRS
from visavis.study.source import Fact

FACTS: Final = (
    Fact("design", "walks of set B", 27, "section 3.1", of="trials"),
    Fact("design", "emotions on Russell's circle", 9, "section 3.1", of="emotion"),
    Fact("design", "speeds", 3, "section 3.1", of="speed"),
    Fact("design", "pairs of adjectives", 41, "table 1", here=len(PAIRS)),
    Fact(
        "design",
        "walks of set A",
        "ten walks at one speed, rated by other people",
        "section 3.1",
        "not part of this study; `visavis blend --examples set_a` has walks of its kind",
        because="it asks the same of fewer walks",
    ),
    Fact(
        "design",
        "where the walks come from",
        "captured from an actor",
        "section 3.1",
        "computed by a gait of some twenty numbers a style",
        because="captured walks may not be passed on; a laboratory's own BVH files can be rated",
    ),
    Fact(
        "procedure",
        "list",
        "all pairs of a walk on one list, answered in any order, buttons coloured by the value",
        "section 3.3, figure 2",
    ),
    Fact(
        "procedure",
        "reference",
        "a red figure in a normal walk beside the green one, both in a loop",
        "figure 2",
    ),
    Fact("procedure", "camera", "free", "section 3.3"),
    Fact(
        "procedure",
        "order of walks",
        "not said",
        "section 3.3",
        "balanced over participants (Williams)",
        because="an order that is the same for everybody would be part of every mean",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "language",
        "Japanese",
        "table 1",
        "English, German and French, in our own words",
        because="wordings of other languages are not translations of one another",
    ),
    Fact("procedure", "scale", "five points, −2 to 2", "section 3.3"),
    Fact(
        "measure",
        "pairs that are kept",
        "mean of some walk at least 1.0 from the middle; mean spread at most .85",
        "section 3.4",
        "the same, with the standard deviation as the spread",
        because="the source says distribution; its threshold fits a standard deviation",
    ),
    Fact(
        "measure",
        "primary parameters",
        "means of the pairs of four clusters by Ward's method",
        "section 3.5, figures 3 and 4",
    ),
    Fact(
        "result",
        "pairs that were kept",
        "27 of set A, 29 of set B",
        "tables 2 and 3",
        "counted in the report, each pair beside both tables",
        because="ours are rated by other people on other walks",
    ),
)

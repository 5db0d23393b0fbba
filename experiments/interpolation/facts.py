"""What the source of the interpolation study says about design, procedure, measures, tests."""

from typing import Final

from visavis.experiments.interpolation.gestures import GESTURES, HOLD_S, KEYS, seconds_of
from visavis.experiments.interpolation.published import METHODS, SUBSETS, Subset
from visavis.study.source import Fact, PrintedOrder

_SECONDS: Final = [round(seconds_of(name) - HOLD_S, 3) for name in GESTURES]
_SQUAD: Final = "squad > slerp, lineuler"
_GAIN: Final = ("method", "squad", "lineuler")
_NEAR: Final = (
    "simulated raters are fitted to the twelve printed means within a fifth of a step, and these "
    "advantages are hardly farther apart"
)


def _subset(subset: Subset) -> Fact:
    """Return the printed means and p of a subset of ratings, beside what the report has of it."""
    means = ", ".join(f"{name} {mean}" for name, mean in zip(METHODS, subset.means, strict=True))
    own = reason = ""
    if subset.name == "pilot":
        own, reason = "no counterpart", "who tried the study beforehand is not part of it"
    if subset.name == "panel":
        own = "raters who say that a panel sent them"
        reason = "the panel's own identifier of a rater is stored apart from the answers"
    return Fact(
        "result",
        f"{subset.name}, n = {subset.n}",
        f"{means}; p = {subset.p}",
        subset.where,
        own,
        because=reason,
    )


FACTS: Final = (
    Fact(
        "design",
        "fewest participants by a power analysis",
        "48, from the pilot's data, for a power of 80 %",
        "section 3.5",
        "whatever `visavis power interpolation` says",
        because="no pilot comes with Visavis; simulated raters stand in for it",
    ),
    Fact("design", "gestures", 4, "section 3.2", of="gesture"),
    Fact("design", "methods", 3, "section 3.2", of="method"),
    Fact("design", "films", 12, "section 3.3", of="trials"),
    Fact("design", "films of a gesture together", 3, "section 3.4", of="trials_in_block"),
    Fact(
        "design",
        "order of gestures",
        "counterbalanced, random",
        "section 3.4",
        "a row of a Williams square by participant",
        because="it also balances which gesture follows which",
        is_stronger=True,
    ),
    Fact("design", "order of methods in a gesture", "random", "section 3.4", of="order"),
    Fact("design", "key poses of a gesture", 4, "section 3.3", here=KEYS),
    Fact(
        "design",
        "how key poses are chosen",
        "by the researchers' judgment, marked by a script",
        "sections 3.3 and 5",
        "greedily: both ends, then one after the other the pose that Slerp between those so far "
        "misses most, which need not be the best four",
        because="a judgment cannot be repeated",
    ),
    Fact(
        "design",
        "gestures' motion",
        "captured (Xsens, Mixamo)",
        "section 3.3",
        "drawn by us: where arms point at a few moments, smooth in between",
        because="the source's recordings may not be passed on",
    ),
    Fact(
        "design",
        "length of a gesture in seconds",
        "1.6 to 2.4",
        "section 3.3",
        here=f"{min(_SECONDS):g} to {max(_SECONDS):g}",
    ),
    Fact(
        "design",
        "character",
        "X Bot (Mixamo)",
        "section 3.3",
        "a man of Visavis' own cast",
        because="only models that may be passed on come with Visavis",
    ),
    Fact("procedure", "place", "browser", "section 3.3", of="place"),
    Fact(
        "procedure",
        "raters",
        "Prolific, and a department's list",
        "section 3.3",
        "whom a lab invites; who sent them is stored apart from their answers",
        because="answers must not lead to persons",
    ),
    Fact("procedure", "loop of a film", "round after round", "section 3.4"),
    Fact(
        "procedure",
        "caption",
        "what the character does, one of four printed",
        "section 3.4",
        "what the character does, in our words",
        because="three of the four are not printed",
    ),
    Fact(
        "procedure",
        "labels of the scale",
        "both ends; inner steps in the discussion alone",
        "sections 3.2 and 4",
        "all five, the inner ones as in the discussion",
        because="steps without a label are read differently by everybody",
    ),
    Fact("procedure", "scale", "1 to 5", "section 3.2", of="naturalness"),
    Fact(
        "procedure",
        "when an answer counts",
        "after viewing",
        "section 3.4",
        "after one whole round",
        because="somebody who has not seen the whole gesture cannot rate it",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "questions about the rater",
        "age, gender, race, education, experience with animation, first",
        "section 3.4",
        "the same but for race, last",
        because="race serves no hypothesis, and questions about oneself can change ratings",
    ),
    Fact(
        "procedure",
        "time spent on a film",
        "kept by a hidden timer",
        "section 3.4",
        "from the film's first picture to the answer",
        because="time in which a film still loads is not spent on it",
    ),
    Fact("measure", "naturalness", "rating of each film", "section 3.2"),
    Fact(
        "test",
        "test of methods",
        "means by linear regression, then one-way analysis of variance of all ratings as if "
        "independent, Tukey's pairs",
        "section 3.5",
        "repeated measures of raters' means; a cumulative link mixed model and the source's own "
        "analysis beside it",
        because="twelve ratings of one person are not independent",
        is_stronger=True,
    ),
    Fact(
        "test",
        "Slerp against LinEuler",
        "no significant difference",
        "section 3.5",
        "a test of equivalence within a quarter of a step beside it",
        because="no difference found is none shown",
        is_stronger=True,
    ),
    Fact(
        "test",
        "experience, gesture, gender",
        "analysed within each group",
        "tables 4 to 6",
        "the same, corrected as one family",
        because="eight tests at .05 find something by chance",
        is_stronger=True,
    ),
    Fact(
        "test",
        "who is left out",
        "rules against patterns and random answers, not stated",
        "section 3.4",
        "ten or more of twelve answers the same, or a pattern of at most three repeated",
        because="the source does not state its rules",
    ),
    *(_subset(subset) for subset in SUBSETS),
)
ORDERS: Final = (
    PrintedOrder(_SQUAD, "naturalness", "table 2", factor="method"),
    PrintedOrder(
        "4 > squad > 3 > slerp, lineuler > 2",
        "naturalness",
        "section 4",
        factor="method",
        words='Squad lies between "neutral" and "somewhat natural", the others one step below',
    ),
    PrintedOrder(
        "experienced > novice",
        "naturalness",
        "section 4",
        factor="experience",
        gain=_GAIN,
        words="Squad's advantage over LinEuler is greater for experienced raters",
    ),
    *(
        PrintedOrder(_SQUAD, "naturalness", "table 5", factor="method", only={"gesture": gesture})
        for gesture in GESTURES
    ),
    PrintedOrder(
        "iconic > beat, metaphoric, deictic",
        "naturalness",
        "section 4",
        factor="gesture",
        gain=_GAIN,
        words="Squad's advantage over LinEuler is greatest for the iconic gesture",
        not_reproduced=_NEAR,
    ),
    PrintedOrder(
        "iconic, beat, metaphoric > deictic",
        "naturalness",
        "section 4",
        factor="gesture",
        gain=_GAIN,
        words="Squad's advantage over LinEuler is least for the deictic gesture",
        not_reproduced=_NEAR,
    ),
)

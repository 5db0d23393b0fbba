"""What the source of the matching study says about its design, procedure, measures and results."""

from typing import Final

from visavis.experiments.matching.interfaces import PLACES, TARGETS, slider_names
from visavis.study.source import Fact, PrintedOrder

FACTS: Final = (
    Fact("design", "targets", 5, "section 6.1", here=len(TARGETS)),
    Fact("design", "walks that are blended", 27, "section 6", here=len(slider_names("weights"))),
    Fact(
        "design",
        "interfaces",
        "four adjectives, four features, the weights of 27 walks",
        "section 6",
    ),
    Fact("design", "practice targets", 3, "section 6.1", here=len(PLACES) - len(TARGETS)),
    Fact(
        "design",
        "choice of targets",
        "random adjectives; five chosen that cover various kinds of walks",
        "section 6",
        "the same; a rule chooses those that lie beyond a match from where sliders begin, and far "
        "from each other",
        because="a target within a match of the beginning would ask nothing of anybody; among our "
        "walks most of those beyond are sad or tired",
    ),
    Fact(
        "design",
        "further adjectives",
        "can be added to the four; nobody needed any",
        "section 6.3",
        "four adjectives alone",
        because="what nobody used cannot make a difference",
    ),
    Fact(
        "procedure",
        "figures",
        "the target in green, the walk that is made in blue",
        "figure 6",
    ),
    Fact(
        "procedure",
        "blind guess",
        "with each interface, before any is adjusted, without seeing what it makes",
        "section 6.1",
    ),
    Fact(
        "procedure",
        "where adjusting begins",
        "at the guess; not adjusted where the guess is a match",
        "section 6.1",
    ),
    Fact(
        "procedure",
        "end of adjusting",
        "D below 0.06 m, or 300 s",
        "section 6.1",
    ),
    Fact(
        "procedure",
        "order of interfaces",
        "weights, adjectives, features for everybody",
        "section 6.1",
        "balanced over participants (Williams); --set order=fixed is the printed order",
        because="what comes last is done by people who know the target better",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "order of targets",
        "not said",
        "section 6.1",
        "balanced over participants (Williams)",
        because="practice would be part of what targets differ in",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "practice",
        "three random targets, until the interfaces are familiar",
        "section 6.1",
        "three targets, one with each interface, the same for everybody",
        because="equal practice keeps people comparable",
        is_stronger=True,
    ),
    Fact(
        "procedure",
        "where sliders begin",
        "not said",
        "section 6.1",
        "all in the middle, those of weights, too",
        because="one rule for all three; a weight of none for every walk would be no walk",
    ),
    Fact(
        "procedure",
        "film of all walks",
        "on a second screen, to help with weights",
        "section 6.1",
        "none; sliders of weights are called by emotion and speed",
        because="people at home have one screen",
    ),
    Fact(
        "procedure",
        "comments",
        "collected after the experiment",
        "section 6.1",
        "not asked",
        because="a laboratory adds its own questionnaire",
    ),
    Fact(
        "measure",
        "distance D",
        "distances of 20 joints at 10 moments aligned by key times; printed as a sum, called an "
        "average",
        "equation 8",
        "their mean",
        because="0.06 m makes sense of a mean alone",
    ),
    Fact(
        "measure",
        "time",
        "300 s where there was no match",
        "section 6.1",
        "the same, and as a censored time in a survival analysis",
        because="who was stopped at 300 s would have needed more",
        is_stronger=True,
    ),
    Fact(
        "test",
        "pairs of interfaces",
        "Wilcoxon's signed-rank test for each target and over all, the pairs of a person and a "
        "target taken as independent",
        "section 6.2",
        "the same, by the normal approximation without continuity correction and exactly; the "
        "planned tests compare people's means",
        because="pairs of one person are not independent; the printed p follow from the normal "
        "approximation",
        is_stronger=True,
    ),
    Fact(
        "result",
        "features against adjectives, by target",
        "features guessed nearer and took less time with targets 2 and 5, adjectives took less "
        "time with target 3; no difference with the others",
        "section 6.2",
        "each p stands beside the printed one of the target of its number",
        because="which walks the source's targets were is shown in a video alone, so ours are not "
        "the same",
    ),
    Fact(
        "result",
        "features against adjectives, time over all targets",
        "p = 0.652, no difference",
        "section 6.2",
    ),
)
ORDERS: Final = (
    PrintedOrder(
        "weights > adjectives, features",
        "guess_m",
        "section 6.2",
        factor="interface",
        only={"phase": "guess"},
    ),
    PrintedOrder(
        "adjectives > features",
        "guess_m",
        "section 6.2",
        factor="interface",
        only={"phase": "guess"},
        not_reproduced="what a slider is called is not among what simulated people know, and "
        "among our walks four adjectives reach targets as nearly as four features",
    ),
    PrintedOrder(
        "weights > adjectives, features",
        "time_s",
        "section 6.2",
        factor="interface",
        only={"phase": "adjust"},
    ),
)
"""What is significant over all five targets."""

"""What the source of both studies of speaking bodies says about its design, procedure and tests."""

from typing import Final

from visavis.experiments.gestures import published
from visavis.experiments.gestures.clips import PART_S, PARTS, VERSIONS
from visavis.study.source import Fact, PrintedOrder

WHERE: Final = "section 6"
OF_BOTH: Final = (
    Fact("design", "parts of the speech", 3, WHERE, here=len(PARTS)),
    Fact("design", "seconds of the speech", 33, WHERE, here=round(PART_S * len(PARTS))),
    Fact("design", "versions of a moving body", 4, WHERE, here=len(VERSIONS)),
    Fact(
        "design",
        "gestures",
        "a clip of the authors' earlier work",
        WHERE,
        "fifteen gestures of ours to the first lines of Mark Antony's speech",
        because="the source's clip is not passed on with it",
    ),
    Fact(
        "design",
        "speaker from whom bodies are learned",
        "captured, annotated by hand",
        "section 3",
        "a synthetic speaker of ours; a lab puts its own there (`clips.py`)",
        because="the captured speaker is not passed on with the source",
    ),
    Fact(
        "procedure",
        "sound",
        "the speech is heard",
        WHERE,
    ),
    Fact(
        "procedure",
        "people",
        "14 men and 7 women of the United States and Germany, 23 to 46 years old",
        WHERE,
        "whom a lab invites; age and gender are asked",
        because="a lab recruits its own",
    ),
    Fact(
        "procedure",
        "both studies",
        "taken by the same people",
        WHERE,
        "two studies, gestures and gesture_pairs, in which the same people may take part",
        because="each is planned, and can be run, alone",
    ),
)
OF_CLIPS: Final = (
    Fact("design", "clips", 36, WHERE, of="trials"),
    Fact("design", "order of clips", "random", WHERE, of="order"),
    Fact("design", "showings of a clip without body motion", 4, WHERE, here=len(VERSIONS)),
    *OF_BOTH,
    Fact("procedure", "replay", "not possible", WHERE),
    Fact("procedure", "scale", "-2 to 2", WHERE, of="naturalness"),
    Fact(
        "procedure",
        "labels of the scale",
        "every option numbered, the ends 'not at all' and 'very much'",
        WHERE,
    ),
    Fact(
        "test",
        "tests of bodies",
        "t tests of two bodies as if seen by different people",
        WHERE,
        "repeated measures, or Friedman's test, over people's means; the source's t tests, and "
        "paired ones, beside it",
        because="everybody saw all bodies",
        is_stronger=True,
    ),
    Fact(
        "result",
        "t(40) of two bodies",
        "; ".join(f"{a} – {b} {t:g}" for (a, b), t in published.TESTS.items()),
        WHERE,
    ),
)
OF_PAIRS: Final = (
    Fact("design", "pairs", 12, WHERE, of="trials"),
    Fact("design", "side of a body", "random", WHERE),
    *OF_BOTH,
    Fact("procedure", "replay", "as often as wished", WHERE),
    Fact("procedure", "answers", 5, WHERE, of="vote"),
    Fact(
        "procedure",
        "labels of the answers",
        "left one, rather left one, both equal, rather right one, right one",
        WHERE,
    ),
    Fact("test", "test of votes", "one-sample t test against 0", WHERE),
    Fact(
        "result",
        "mean vote, -2 for the corpus, with its t(20)",
        f"{published.VOTES_MEAN:g}, t = {published.VOTES_T:g}",
        WHERE,
    ),
)
ORDERS_OF_CLIPS: Final = (
    PrintedOrder("corpus > holds > still", "naturalness", WHERE, factor="body"),
)
ORDERS_OF_PAIRS: Final = (
    PrintedOrder("0 > vote_for_holds", "vote_for_holds", WHERE, words="votes are for the corpus"),
)

"""What the source prints of the study, and what of it does not hold together.

A. Jovane, Virtual humans: from motion to interaction (thesis, Université de Rennes, 2023),
chapter 2, sections 2.3.1 to 2.3.3. Means per direction are in figures only.
"""

from dataclasses import dataclass
from typing import Final

from analysis.statistics.printed import PublishedCheck
from analysis.statistics.published import check_f

CITATION: Final = (
    "A. Jovane, thesis, Université de Rennes, 2023, chapter 2 (visual motion warping), section 2.3."
)
PARTICIPANTS: Final = 16


@dataclass(frozen=True)
class PublishedEffect:
    """One printed F test; texts are as printed, None where nothing is."""

    measure: str
    term: str
    F: str | None
    df1: int
    df2: int
    p: str | None
    eta2p: str | None
    is_significant: bool


EFFECTS: Final = (
    PublishedEffect("accuracy", "technique", "7.09", 1, 15, "0.017", "0.32", True),
    PublishedEffect("accuracy", "direction", "18.92", 2, 30, "<0.001", "0.356", True),
    PublishedEffect("accuracy", "technique:direction", "2.19", 2, 30, "0.12", "0.12", False),
    PublishedEffect("realism", "technique", None, 1, 15, None, None, False),
    PublishedEffect("realism", "direction", "3.97", 2, 30, "0.03", "0.21", True),
    PublishedEffect("realism", "technique:direction", None, 2, 30, None, None, False),
)
MEAN_ACCURACY: Final = {"orientation": (0.59, 0.25), "warping": (0.67, 0.20)}
"""Mean and SD as printed; over what the SD is taken is not said."""
IN_WORDS: Final = (
    "Participants were less accurate when the wave was to their right, and rated it less "
    "realistic there than when it was to themselves. All named the eyes as a cue, a quarter of "
    "them nothing else."
)


def published_effect(measure: str, term: str) -> PublishedEffect:
    """Return what is printed of an effect."""
    return next(e for e in EFFECTS if (e.measure, e.term) == (measure, term))


def check_effect(effect: PublishedEffect) -> PublishedCheck | None:
    """Check p and partial eta squared of a printed F; None where none is printed."""
    if effect.F is None:
        return None
    return check_f(effect.F, effect.df1, effect.df2, p=effect.p, eta=effect.eta2p)

"""Predict a speaker's weight shift and hip direction for the next phrase, from annotated speech.

Two habits are put together: how one posture follows another (a Markov chain), and what goes with
the gesture of a phrase (rules from its hand and its lexeme, kept when frequent and reliable).
Source: a study of gestures with full-body posture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector

Part: TypeAlias = Literal["com", "yaw"]
CLASSES: Final[dict[str, tuple[str, ...]]] = {
    "com": ("left", "centre", "right"),
    "yaw": ("left", "front", "right"),
}
"""Where the centre of mass is, and where the hips point, at the end of a phrase."""


class Phrase(NamedTuple):
    """One annotated phrase: the hand (LH, RH, 2H), the gesture's lexeme, the posture at its end."""

    hand: str
    lexeme: str
    com: str
    yaw: str


class Rule(NamedTuple):
    """A rule from a gesture to a posture: `by` H (its hand), L (its lexeme) or HL (both).

    `with_gesture` phrases have the antecedent, `with_posture` of them the posture, too.
    """

    by: str
    posture: str
    with_gesture: int
    with_posture: int

    @property
    def confidence(self) -> float:
        """Share of the antecedent's phrases with this posture."""
        return self.with_posture / self.with_gesture


@dataclass(frozen=True)
class Habits:
    """Statistics of phrases in the order they were spoken.

    `beta` is the rules' share beside the chain's. Rules hold from `min_support` of all phrases and
    `min_confidence` on. `first_of_takes` are the phrases (counted from 0) that begin another
    recording: they follow nothing.
    """

    phrases: tuple[Phrase, ...]
    beta: float = 0.65
    min_support: float = 0.02
    min_confidence: float = 0.30
    first_of_takes: frozenset[int] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "phrases", tuple(Phrase(*p) for p in self.phrases))
        if not 0 <= self.beta <= 1:
            raise DataError(f"beta is {self.beta}; it is a share from 0 to 1")
        for row, phrase in enumerate(self.phrases, 1):
            for part, classes in CLASSES.items():
                if getattr(phrase, part) not in classes:
                    raise DataError(
                        f"phrase {row}: {part} is {getattr(phrase, part)!r}; it is one "
                        f"of {', '.join(classes)}"
                    )

    @cached_property
    def _codes(self) -> dict[str, npt.NDArray[np.int64]]:
        return {
            part: np.array([classes.index(getattr(p, part)) for p in self.phrases], dtype=np.int64)
            for part, classes in CLASSES.items()
        }

    def chain(self, part: Part, posture: str) -> Vector:
        """Return how often each posture followed one, shape (3,), summing to 1.

        Raises:
            DataError: nothing ever followed it.
        """
        follows = self._followers(part, posture)
        if not follows.size:
            raise DataError(f"no phrase follows one with {part} {posture}; annotate more speech")
        counts: Vector = np.bincount(follows, minlength=3) / follows.size
        return counts

    def follower_count(self, part: Part, posture: str) -> int:
        """Return how many phrases follow one that ended in a posture."""
        return len(self._followers(part, posture))

    def _followers(self, part: Part, posture: str) -> npt.NDArray[np.int64]:
        codes = self._codes[part]
        goes_on = [row not in self.first_of_takes for row in range(1, len(codes))]
        is_before = codes[:-1] == CLASSES[part].index(posture)
        following: npt.NDArray[np.int64] = codes[1:][is_before & np.array(goes_on, dtype=np.bool_)]
        return following

    def rules(self, part: Part, hand: str, lexeme: str) -> list[Rule]:
        """Return the rules that hold for a gesture, posture by posture."""
        matching = []
        hands = np.array([p.hand == hand for p in self.phrases])
        lexemes = np.array([p.lexeme == lexeme for p in self.phrases])
        for code, posture in enumerate(CLASSES[part]):
            with_posture = self._codes[part] == code
            for by, holds in (("H", hands), ("L", lexemes), ("HL", hands & lexemes)):
                count, joint = int(holds.sum()), int((holds & with_posture).sum())
                if not count or count / len(self.phrases) < self.min_support:
                    continue
                rule = Rule(by, posture, count, joint)
                if rule.confidence >= self.min_confidence:
                    matching.append(rule)
        return matching

    def probability(self, part: Part, posture: str, hand: str, lexeme: str) -> Vector:
        """Return how probable each posture is at the end of the next phrase, shape (3,)."""
        chain = self.chain(part, posture)
        rules = self.rules(part, hand, lexeme)
        if not rules:
            return chain
        mixture = (1 - self.beta) * chain + self.beta * strongest(part, rules)
        together: Vector = mixture / mixture.sum()
        return together

    def joint(self, com: str, yaw: str, hand: str, lexeme: str) -> Vector:
        """Return how probable each pair of postures is, shape (9,), the centre of mass slowest."""
        coms = self.probability("com", com, hand, lexeme)
        yaws = self.probability("yaw", yaw, hand, lexeme)
        return np.outer(coms, yaws).ravel()


def strongest(part: Part, rules: Sequence[Rule]) -> Vector:
    """Return the highest confidence of each posture's rules, shape (3,); 0 where there is none."""
    best = np.zeros(3)
    for rule in rules:
        k = CLASSES[part].index(rule.posture)
        best[k] = max(best[k], rule.confidence)
    return best

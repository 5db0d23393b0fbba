"""The questions for a participant: each has its choices, the meaning of answers and its columns.

A response is data. Its words stand in the study's text files (`questions.NAME`,
`choices.NAME.OPTION`); how it is asked (board, ray, gaze, keys, terminal) is
`visavis.study.asking`'s.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, TypeAlias

from visavis.lab.errors import DesignError
from visavis.lab.kinds import of_kinds
from visavis.protocol.plan.columns import Column
from visavis.protocol.plan.steps import Scalar

MAX_CHOICES = 9
"""As many options as there are digits on a keyboard."""
ANSWER_ENDINGS: Final = (
    "",
    "_by",
    "_ms",
    "_is_right",
    "_means",
    "_side",
    "_distance_m",
    "_yaw_deg",
    "_pitch_deg",
)
"""Endings of the columns that an answer adds to a trial's row, what was typed left out."""
ONE_KEY: Final = (*"abcdefghijklmnopqrstuvwxyz", "space", "enter", "left", "right", "up", "down")
"""Names that are more likely a key's than an answer's."""
WAYS = "ray, gaze, keys, keyboard, mouse, touch, pen, pasted or operator"


@dataclass(frozen=True)
class _Response:
    """A question with a name; an option means itself, and an answer has no further columns."""

    name: str

    def __post_init__(self) -> None:
        if not self.name.isidentifier():
            raise DesignError(
                f"a response is called {self.name!r}; give a name of letters, digits and _"
            )

    def value(self, option: str) -> Scalar | None:
        """Return what an option means."""
        return option

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        return (
            self._answer_column,
            Column(f"{self.name}_by", "", f"how it was answered: {WAYS}"),
            Column(
                f"{self.name}_ms",
                "ms",
                "from the first frame of the question, or of its film, to the answer; missing "
                "without one",
            ),
            *self._further,
        )

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return the further columns of an answer."""
        return {}

    @property
    def _answer_column(self) -> Column:
        raise NotImplementedError

    @property
    def _further(self) -> tuple[Column, ...]:
        return ()


@dataclass(frozen=True)
class _OptionResponse(_Response):
    """One of several `options`; `right` is the correct one, if there is one."""

    options: Sequence[str]
    right: str | None = None
    aggregate: ClassVar[str] = "share"
    _words: ClassVar[tuple[str, str, str]]

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "options", tuple(map(str, self.options)))
        if len(set(self.options)) < len(self.options):
            raise DesignError(
                f"{self._words[0]} {self.name}: one of its {self._words[1]} is there twice: "
                f"{', '.join(self.options)}"
            )
        if self.right is not None and self.right not in self.options:
            raise DesignError(
                f"{self._words[0]} {self.name}: {self.right!r} is none of its {self._words[1]}"
            )

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return whether the answer is right, where an option is."""
        if self.right is None:
            return {}
        return {f"{self.name}_is_right": None if option is None else option == self.right}

    @property
    def _answer_column(self) -> Column:
        return Column(self.name, "", f"{self._words[2]}: {', '.join(self.options)}")

    @property
    def _further(self) -> tuple[Column, ...]:
        if self.right is None:
            return ()
        description = f"{self._words[2]} is the right one"
        return (Column(f"{self.name}_is_right", "", description),)


@dataclass(frozen=True)
@of_kinds()
class Rating(_Response):
    """A whole number from `low` to `high`."""

    low: int = 1
    high: int = 7
    aggregate: ClassVar[str] = "mean"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.high - self.low < MAX_CHOICES:
            raise DesignError(
                f"rating {self.name} goes from {self.low} to {self.high}; give 2 to {MAX_CHOICES} "
                "steps"
            )

    @property
    def options(self) -> tuple[str, ...]:
        """The choices in order, as they are stored."""
        return tuple(str(n) for n in range(self.low, self.high + 1))

    def value(self, option: str) -> Scalar:
        """Return what an option means."""
        return int(option)

    @property
    def _answer_column(self) -> Column:
        return Column(self.name, "1", f"{self.low} low to {self.high} high")


@dataclass(frozen=True)
@of_kinds(
    options=Sequence[Scalar], labels=Sequence[Scalar], means=Sequence[Scalar], keys=Sequence[Scalar]
)
class Choice(_OptionResponse):
    """One of several options (n-AFC); `right` is the correct one, if there is one.

    `labels` are the words for the options on this occasion, in their order, if they vary between
    trials; like options they are translated by `choices.NAME.LABEL`. `means` is what each option
    means on this occasion, in their order, where it is not the option itself: in a trial with sides
    swapped "left" means another thing. Left out, it is the labels. The row keeps it as
    `NAME_means`, and reports count meanings; their words are `choices.NAME.MEANING` too. `keys` are
    letters that stand for the options on a page, in their order, beside their digits; elsewhere
    the digits alone do.
    """

    labels: Sequence[str] = ()
    means: Sequence[str] = ()
    keys: Sequence[str] = ()
    _words = ("choice", "options", "the option chosen")

    @property
    def meanings(self) -> tuple[str, ...]:
        """What the options mean on this occasion, in their order."""
        return tuple(self.means or self.labels or self.options)

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return whether the answer is right, and what it means, where an option has either."""
        row = super().more(option)
        if self.means or self.labels:
            at = None if option is None else self.options.index(option)
            row[f"{self.name}_means"] = None if at is None else self.meanings[at]
        return row

    @property
    def _further(self) -> tuple[Column, ...]:
        if not (self.means or self.labels):
            return super()._further
        words = "what the option chosen meant in this trial"
        return (*super()._further, Column(f"{self.name}_means", "", words))

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 2 <= len(self.options) <= MAX_CHOICES:
            raise DesignError(f"choice {self.name} has {len(self.options)} options; give 2 to 9")
        object.__setattr__(self, "labels", tuple(map(str, self.labels)))
        if self.labels and len(set(self.labels)) != len(self.options):
            raise DesignError(f"choice {self.name}: give each of its options a label of its own")
        object.__setattr__(self, "means", tuple(map(str, self.means)))
        if self.means and len(self.means) != len(self.options):
            raise DesignError(
                f"choice {self.name} has {len(self.options)} options and {len(self.means)} meanings"
            )
        keys = tuple(str(key).lower() for key in self.keys)
        object.__setattr__(self, "keys", keys)
        if keys and (
            len(set(keys)) != len(self.options) or not all(re.fullmatch("[a-z]", k) for k in keys)
        ):
            raise DesignError(
                f"choice {self.name} has {len(self.options)} options and the keys "
                f"{', '.join(keys)}; give each option a letter of its own, a to z"
            )


@dataclass(frozen=True)
@of_kinds(left=Scalar, right=Scalar)
class SideBySide(_Response):
    """Which of two things shown side by side; `left` and `right` name what was shown there."""

    left: str
    right: str
    options: ClassVar[tuple[str, ...]] = ("left", "right")
    aggregate: ClassVar[str] = "share"

    def value(self, option: str) -> Scalar:
        """Return what was shown on the chosen side."""
        return self.left if option == "left" else self.right

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return the side chosen."""
        return {f"{self.name}_side": option}

    @property
    def _answer_column(self) -> Column:
        return Column(self.name, "", "what stood on the side chosen")

    @property
    def _further(self) -> tuple[Column, ...]:
        return (Column(f"{self.name}_side", "", "the side chosen"),)


@dataclass(frozen=True)
@of_kinds()
class FreeText(_Response):
    """Free text, typed."""

    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = ""

    @property
    def _answer_column(self) -> Column:
        return Column(self.name, "", "in the participant's words")


@dataclass(frozen=True)
@of_kinds(unit=Any)
class Number(_Response):
    """A typed number; missing when the text is not a number or out of bounds.

    With a `step` a page shows a slider from `low` to `high`, which has no value until it is moved.
    """

    unit: str = "1"
    low: float = float("-inf")
    high: float = float("inf")
    step: float = 0.0
    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = "mean"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.unit, str):
            raise DesignError(
                f"number {self.name}: its unit is {self.unit!r}; bounds have their names: "
                f'Number("{self.name}", low=0, high=100), and a unit is a text: "years"'
            )
        if not self.low <= self.high:
            raise DesignError(f"number {self.name} goes from {self.low} to {self.high}; swap them")
        is_bounded = float("-inf") < self.low < self.high < float("inf")
        if self.step < 0 or (self.step > 0 and not is_bounded):
            raise DesignError(f"number {self.name}: a slider needs low, high and a step above 0")

    def value(self, option: str) -> Scalar | None:
        """Return the number; None where the text is not a number or out of bounds."""
        try:
            number = float(option.replace(",", "."))
        except ValueError:
            return None
        return number if self.low <= number <= self.high else None

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return the answer as typed: nothing recorded is lost."""
        return {f"{self.name}_typed": option}

    @property
    def _answer_column(self) -> Column:
        return Column(self.name, self.unit, "the number answered")

    @property
    def _further(self) -> tuple[Column, ...]:
        return (Column(f"{self.name}_typed", "", "the answer as it was typed"),)


@dataclass(frozen=True, init=False)
@of_kinds(options=Sequence[Scalar])
class Keys(_OptionResponse):
    """A press of one of `options` (controls of the response device), timed from the onset.

    No board appears and the scene stays. `right` is the correct press, if there is one; without a
    press within `limit_s` the answer is missing. Two or more keys without a name are the response
    "answer": `Keys("f", "j")` is `Keys("answer", ("f", "j"))`. `distance_to` names a role in what
    is shown; `NAME_distance_m` is how far that person was at the press
    (`visavis.study.distances`).
    """

    options: Sequence[str]
    limit_s: float = 3.0
    distance_to: str | None = None
    _words = ("keys", "controls", "what was pressed")

    def __init__(
        self,
        name: str,
        options: Sequence[str] = ("trigger",),
        *further: Any,
        right: str | None = None,
        limit_s: float = 3.0,
        distance_to: str | None = None,
    ) -> None:
        if isinstance(options, str):
            name, options, further = "answer", (name, options, *further), ()
        if further:
            right = further[0]
            limit_s = further[1] if len(further) > 1 else limit_s
        for field, value in (("name", name), ("options", options), ("right", right)):
            object.__setattr__(self, field, value)
        object.__setattr__(self, "limit_s", limit_s)
        object.__setattr__(self, "distance_to", distance_to)
        self.__post_init__()

    @property
    def names_no_keys(self) -> bool:
        """Whether it has but a name that may be a key's, and the usual control."""
        return self.options == ("trigger",) and self.name in ONE_KEY

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.options or not self.limit_s > 0:
            raise DesignError(f"keys {self.name}: name at least one control, and limit_s above 0")

    @property
    def _further(self) -> tuple[Column, ...]:
        if self.distance_to is None:
            return super()._further
        description = (
            f"distance on the floor from between the participant's eyes to between those of "
            f"{self.distance_to} as drawn at the press; empty without a press, after that one has "
            "gone, and while the head was not tracked"
        )
        return (*super()._further, Column(f"{self.name}_distance_m", "m", description))


@dataclass(frozen=True)
@of_kinds()
class Pointing(_Response):
    """A direction pointed at with a tracked hand, a controller or the head, then confirmed.

    The ray, and so the place pointed at, is known to `visavis.study.asking`.
    """

    limit_s: float = 30.0
    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = ""

    @property
    def _answer_column(self) -> Column:
        description = "place of the nearest head within 10° of the ray; none: empty"
        return Column(self.name, "", description)

    @property
    def _further(self) -> tuple[Column, ...]:
        return (
            Column(f"{self.name}_yaw_deg", "deg", "direction pointed at, positive to the left"),
            Column(f"{self.name}_pitch_deg", "deg", "direction pointed at, positive upwards"),
        )


Response: TypeAlias = Rating | Choice | SideBySide | FreeText | Number | Keys | Pointing


def kind_of(response: Response) -> str:
    """Return the kind of a response as recordings name it; free text has kept its first name."""
    return "Text" if isinstance(response, FreeText) else type(response).__name__


def labels_of(response: Response) -> tuple[str, ...]:
    """Return the labels of the options on this occasion, by the names of their texts."""
    return tuple(getattr(response, "labels", ()) or response.options)

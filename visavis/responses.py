"""What a participant can be asked: each says its choices, what an answer means, and its columns.

A response is data. Its words stand in the study's text files (`questions.NAME`,
`choices.NAME.OPTION`); how it is asked (board, ray, gaze, keys, terminal) is `visavis.asking`'s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from lab.errors import DesignError
from protocol.columns import Column
from protocol.steps import Scalar

MAX_CHOICES = 9
"""As many as have a digit of their own on a keyboard."""


def _check_name(name: str) -> None:
    if not name.isidentifier():
        raise DesignError(f"a response is called {name!r}; give a name of letters, digits and _")


@dataclass(frozen=True)
class Rating:
    """A whole number from `low` to `high`."""

    name: str
    low: int = 1
    high: int = 7
    aggregate: ClassVar[str] = "mean"

    def __post_init__(self) -> None:
        _check_name(self.name)
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

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        return (Column(self.name, "1", f"{self.low} low to {self.high} high"), *_how(self.name))

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return what else an answer says; nothing here."""
        return {}


@dataclass(frozen=True)
class Choice:
    """One of several options (n-AFC); `right` is the one that counts as correct, if any does.

    `labels` are what the options are called on this occasion, in their order, where that is not
    always the same; like options they are translated by `choices.NAME.LABEL`.
    """

    name: str
    options: Sequence[str]
    right: str | None = None
    labels: Sequence[str] = ()
    aggregate: ClassVar[str] = "share"

    def __post_init__(self) -> None:
        _check_name(self.name)
        object.__setattr__(self, "options", tuple(map(str, self.options)))
        if not 2 <= len(self.options) <= MAX_CHOICES:
            raise DesignError(f"choice {self.name} has {len(self.options)} options; give 2 to 9")
        if len(set(self.options)) < len(self.options):
            raise DesignError(f"choice {self.name} has an option twice: {', '.join(self.options)}")
        object.__setattr__(self, "labels", tuple(map(str, self.labels)))
        if self.labels and len(set(self.labels)) != len(self.options):
            raise DesignError(f"choice {self.name}: give each of its options a label of its own")
        if self.right is not None and self.right not in self.options:
            raise DesignError(f"choice {self.name}: {self.right!r} is none of its options")

    def value(self, option: str) -> Scalar:
        """Return what an option means."""
        return option

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        given = Column(self.name, "", f"the option chosen: {', '.join(self.options)}")
        if self.right is None:
            return (given, *_how(self.name))
        right = Column(f"{self.name}_is_right", "", "the option chosen is the right one")
        return (given, *_how(self.name), right)

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return whether the answer is right, where an option is."""
        if self.right is None:
            return {}
        return {f"{self.name}_is_right": None if option is None else option == self.right}


@dataclass(frozen=True)
class SideBySide:
    """Which of two things shown beside each other; `left` and `right` say what stood there."""

    name: str
    left: str
    right: str
    options: ClassVar[tuple[str, ...]] = ("left", "right")
    aggregate: ClassVar[str] = "share"

    def __post_init__(self) -> None:
        _check_name(self.name)

    def value(self, option: str) -> Scalar:
        """Return what stood on the side chosen."""
        return self.left if option == "left" else self.right

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        chosen = Column(self.name, "", "what stood on the side chosen")
        return (chosen, *_how(self.name), Column(f"{self.name}_side", "", "the side chosen"))

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return the side chosen."""
        return {f"{self.name}_side": option}


@dataclass(frozen=True)
class Text:
    """Free text, typed."""

    name: str
    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = ""

    def __post_init__(self) -> None:
        _check_name(self.name)

    def value(self, option: str) -> Scalar:
        """Return the text itself."""
        return option

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        return (Column(self.name, "", "in the participant's words"), *_how(self.name))

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return what else an answer says; nothing here."""
        return {}


@dataclass(frozen=True)
class Number:
    """A number, typed; missing when it is none or lies outside the bounds.

    With a `step` a page shows a slider from `low` to `high`, which has no place until it is moved.
    """

    name: str
    unit: str = "1"
    low: float = float("-inf")
    high: float = float("inf")
    step: float = 0.0
    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = "mean"

    def __post_init__(self) -> None:
        _check_name(self.name)
        bounded = float("-inf") < self.low < self.high < float("inf")
        if self.step < 0 or (self.step > 0 and not bounded):
            raise DesignError(f"number {self.name}: a slider needs low, high and a step above 0")

    def value(self, option: str) -> Scalar | None:
        """Return the number; None where the text is none, or out of bounds."""
        try:
            number = float(option.replace(",", "."))
        except ValueError:
            return None
        return number if self.low <= number <= self.high else None

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        typed = Column(f"{self.name}_typed", "", "the answer as it was typed")
        return (Column(self.name, self.unit, "the number answered"), *_how(self.name), typed)

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return the answer as typed: nothing recorded is lost."""
        return {f"{self.name}_typed": option}


@dataclass(frozen=True)
class Keys:
    """A press of one of `options` (controls of the response device), timed from the onset.

    No board appears: what is shown stays. `right` is the press that counts as correct, if any
    does; without a press within `limit_s` the answer is missing.
    """

    name: str
    options: Sequence[str] = ("trigger",)
    right: str | None = None
    limit_s: float = 3.0
    aggregate: ClassVar[str] = "share"

    def __post_init__(self) -> None:
        _check_name(self.name)
        object.__setattr__(self, "options", tuple(map(str, self.options)))
        if not self.options or not self.limit_s > 0:
            raise DesignError(f"keys {self.name}: name at least one control, and limit_s above 0")
        if self.right is not None and self.right not in self.options:
            raise DesignError(f"keys {self.name}: {self.right!r} is none of its controls")

    def value(self, option: str) -> Scalar:
        """Return the control itself."""
        return option

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        given = Column(self.name, "", f"what was pressed: {', '.join(self.options)}")
        if self.right is None:
            return (given, *_how(self.name))
        right = Column(f"{self.name}_is_right", "", "what was pressed is the right one")
        return (given, *_how(self.name), right)

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return whether the press is right, where one is."""
        if self.right is None:
            return {}
        return {f"{self.name}_is_right": None if option is None else option == self.right}


@dataclass(frozen=True)
class Pointing:
    """A direction pointed at with a tracked hand, a controller or the head, then confirmed."""

    name: str
    options: ClassVar[tuple[str, ...]] = ()
    aggregate: ClassVar[str] = ""
    limit_s: float = 30.0

    def __post_init__(self) -> None:
        _check_name(self.name)

    def value(self, option: str) -> Scalar:
        """Return the agent pointed at."""
        return option

    def columns(self) -> tuple[Column, ...]:
        """Return the columns an answer adds to a trial's row."""
        return (
            Column(self.name, "", "place of the nearest head within 10° of the ray; none: empty"),
            *_how(self.name),
            Column(f"{self.name}_yaw_deg", "deg", "direction pointed at, positive to the left"),
            Column(f"{self.name}_pitch_deg", "deg", "direction pointed at, positive upwards"),
        )

    def more(self, option: str | None) -> dict[str, Scalar | None]:
        """Return nothing: directions are added where the ray is known."""
        return {}


Response: TypeAlias = Rating | Choice | SideBySide | Text | Number | Keys | Pointing


def labels_of(response: Response) -> tuple[str, ...]:
    """Return what the options are called on this occasion, by the names of their texts."""
    return tuple(getattr(response, "labels", ()) or response.options)


def _how(name: str) -> tuple[Column, Column]:
    return (
        Column(
            f"{name}_by",
            "",
            "how it was answered: ray, gaze, keys, keyboard, mouse, touch, pen or operator",
        ),
        Column(
            f"{name}_ms",
            "ms",
            "from the frame that showed the question, or the first one of its film, to the answer",
        ),
    )

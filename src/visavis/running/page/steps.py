"""Steps that a page shows, and checks of its replies, which anybody could forge."""

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from visavis.lab.clock import NS_PER_MS
from visavis.lab.errors import LabError
from visavis.study.live import Slider
from visavis.study.responses import Choice, FreeText, Number, Rating, Response, SideBySide

WAYS: Final = ("keys", "mouse", "touch", "pen", "pasted", "ray")
BY_LIMIT: Final = "limit"
"""How a slider was answered that nobody moved before its step ended by itself."""
MOULDER: Final = "moulder"
PRELOAD: Final = "preload"
"""Kind of the step to which a page replies by itself."""
ENDINGS: Final = ("button", "limit", "near")
MAX_SLIDERS: Final = 100
MAX_ROWS: Final = 2000
"""Most movements of sliders, or of the camera, in one event."""
MAX_NUMBER: Final = 1e12
"""Some thirty years in milliseconds."""
MAX_UNIX_MS: Final = 7_258_118_400_000.0
"""The year 2200."""


class PageError(LabError):
    """A page sent something invalid; nothing of it was accepted."""


class BadEventError(PageError):
    """What one event of a page says cannot be; the page sets it aside and sends the others."""

    def __init__(self, n: int, why: str) -> None:
        super().__init__(why)
        self.n = n


class CannotGoOnError(LabError):
    """A session is there and cannot go on now, by no fault of its page, which remembers it."""


class OpenElsewhereError(LabError):
    """The session is open in another tab or browser."""


@dataclass(frozen=True)
class PageStep:
    """One step of a page: its kind, and its content as JSON data."""

    kind: str
    content: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Reply:
    """A page's reply to a step; `t_ns_of` converts the page's clock to session time.

    `moves` are the events in which the page told of sliders and camera during the step.
    """

    content: Mapping[str, Any]
    t_ns: int
    t_ns_of: Callable[[float], int]
    moves: tuple[Mapping[str, Any], ...] = ()


@dataclass(frozen=True)
class PageAnswer:
    """An answer as the page sent it: its time on the page's clock, and the input it came from.

    `released_ms` is when its key was released; None where no key, or no release, is known.
    """

    option: str | None
    at_ms: float
    by: str
    released_ms: float | None = None


@dataclass(frozen=True)
class FilmPlayback:
    """What a browser presented of one film; times on the page's clock."""

    first_ms: float
    frames: int
    frames_dropped: int
    rounds: int
    stalls: int
    first_at_ms: float | None = None
    """Where in the film the picture of `first_ms` stood; None where the page does not say."""
    sound_ms: float | None = None
    """When its sound began; None for a silent film, or one that was not heard."""
    volume_01: float | None = None
    """How loud the browser played it, 0 where it was muted; None for a silent film."""


def put(step: PageStep) -> Generator[PageStep, Reply | None, Reply]:
    """Put a step to a page and wait for its reply."""
    reply = yield step
    if reply is None:
        raise TypeError(f"the step {step.kind} was answered by nothing")
    return reply


def page_question(response: Response, prompt: str, labels: Sequence[str]) -> dict[str, Any]:
    """Return a question in the form that a page needs.

    Raises:
        PageError: pages cannot ask it.
    """
    question: dict[str, Any] = {"name": response.name, "prompt": prompt}
    options = [
        {"value": str(v), "label": label} for v, label in zip(response.options, labels, strict=True)
    ]
    match response:
        case Slider(low=low, high=high, step=step, start=start):
            return question | {
                "kind": MOULDER,
                "low": low,
                "high": high,
                "step": step,
                "start": start,
            }
        case Rating():
            return question | {"kind": "rating", "options": options}
        case Choice(keys=keys) if keys:
            keyed = [o | {"key": key} for o, key in zip(options, keys, strict=True)]
            return question | {"kind": "choice", "options": keyed}
        case Choice() | SideBySide():
            return question | {"kind": "choice", "options": options}
        case FreeText():
            return question | {"kind": "text"}
        case Number(low=low, high=high, step=step):
            bounds = {k: v for k, v in (("low", low), ("high", high)) if math.isfinite(v)}
            kind = "slider" if step else "number"
            return question | {"kind": kind, "unit": response.unit, "step": step, **bounds}
        case _:
            raise PageError(f"{type(response).__name__} {response.name} cannot be asked on a page")


def read_page_answer(response: Response, content: Any) -> PageAnswer:
    """Read an answer to a response.

    Raises:
        PageError: the content is not an answer to this response.
    """
    answer = mapping(content, f"the answer to {response.name}")
    option, by = answer.get("option"), answer.get("by")
    if option is not None and not isinstance(option, str):
        raise PageError(f"{response.name}: an answer is a text, not {option!r}")
    if option is not None and response.options and option not in map(str, response.options):
        raise PageError(f"{response.name}: {option!r} is none of its options")
    if by not in (*WAYS, BY_LIMIT) or (by == BY_LIMIT and not isinstance(response, Slider)):
        raise PageError(f"{response.name}: answered by {by!r}")
    at_ms, released = number(answer.get("at_ms"), "at_ms"), answer.get("released_ms")
    return PageAnswer(
        option, at_ms, by, None if released is None else number(released, "released_ms")
    )


def read_film(content: Any) -> FilmPlayback:
    """Read a browser's report of how it presented a film.

    Raises:
        PageError: the content is malformed.
    """
    report = mapping(content, "what was presented of a film")
    counts = (count(report.get(name), name) for name in ("frames", "dropped", "rounds", "stalls"))
    frames, frames_dropped, rounds, stalls = counts
    first_at_ms, sound_ms, volume_01 = (
        None if report.get(name) is None else number(report[name], name)
        for name in ("first_at_ms", "sound_ms", "volume_01")
    )
    first_ms = number(report.get("first_ms"), "first_ms")
    return FilmPlayback(
        first_ms, frames, frames_dropped, rounds, stalls, first_at_ms, sound_ms, volume_01
    )


@dataclass(frozen=True)
class Drawn:
    """What a browser drew of a live figure; times on the page's clock, `distance_m` at the end."""

    first_ms: float
    off_ms: float
    ended_by: str
    frames: int
    frames_dropped: int
    slider_frames: int
    distance_m: float | None
    renderer: str
    rounds: int = 0
    opened_ms: float | None = None
    """When the questions about what was watched could be answered first; None: nobody says."""


def read_drawn(content: Mapping[str, Any]) -> Drawn:
    """Read a browser's report of how it drew a live figure; `rounds` are of one that is watched.

    Raises:
        PageError: the content is malformed.
    """
    if content.get("ended_by") not in ENDINGS:
        raise PageError(f"a figure ended by {str(content.get('ended_by'))[:40]!r}")
    renderer = content.get("renderer")
    if not isinstance(renderer, str) or len(renderer) > 200:
        raise PageError("the renderer is a short text")
    distance, opening_ms = content.get("distance_m"), content.get("opened_ms")
    return Drawn(
        number(content.get("first_ms"), "first_ms"),
        number(content.get("off_ms"), "off_ms"),
        content["ended_by"],
        count(content.get("frames"), "frames"),
        count(content.get("dropped"), "dropped"),
        count(content.get("slider_frames"), "slider_frames"),
        None if distance is None else number(distance, "distance_m"),
        renderer,
        count(content.get("rounds", 0), "rounds"),
        None if opening_ms is None else number(opening_ms, "opened_ms"),
    )


def check_moves(content: Mapping[str, Any]) -> None:
    """Refuse movements that are none: `names` of sliders; rows of a slider (time, number of its
    name, value); rows of a camera (time, x, y, z); of figures that are watched rows of `rounds`
    (time, number of the figure).

    Raises:
        PageError: saying what is wrong.
    """
    names = content.get("names")
    if (
        not isinstance(names, list)
        or len(names) > MAX_SLIDERS
        or not all(isinstance(n, str) and n.isidentifier() and len(n) <= 100 for n in names)
    ):
        raise PageError(f"names are those of at most {MAX_SLIDERS} sliders")
    for name, width in (("sliders", 3), ("camera", 4), ("rounds", 2)):
        rows = content.get(name, [] if name == "rounds" else None)
        if not isinstance(rows, list) or len(rows) > MAX_ROWS:
            raise PageError(f"{name} are at most {MAX_ROWS} movements")
        for row in rows:
            if not isinstance(row, list) or len(row) != width:
                raise PageError(f"a movement of {name} has {width} numbers")
            for value in row:
                number(value, name)
            if name == "sliders" and row[1] not in range(len(names)):
                raise PageError(f"there is no slider {row[1]}")
            if name == "rounds" and row[1] not in (0, 1):
                raise PageError(f"there is no figure {row[1]}")


def mapping(content: Any, what: str) -> Mapping[str, Any]:
    """Return an object of JSON.

    Raises:
        PageError: it is something else.
    """
    if not isinstance(content, Mapping):
        raise PageError(f"{what} is not an object: {str(content)[:60]!r}")
    return content


def number(content: Any, what: str) -> float:
    """Return a number that a page can mean, such as a time on its clock in milliseconds.

    Raises:
        PageError: it is something else, or beyond what nanoseconds are counted to.
    """
    if isinstance(content, bool) or not isinstance(content, int | float):
        raise PageError(f"{what} is not a number: {str(content)[:60]!r}")
    if not abs(content) <= MAX_NUMBER:
        raise PageError(f"{what} is {str(content)[:60]}")
    return float(content)


def unix_ms(content: Any, what: str) -> float:
    """Return a time in milliseconds since 1970, as a computer's calendar shows it.

    Raises:
        PageError: it is something else, or a year that no computer shows by mistake.
    """
    if isinstance(content, bool) or not isinstance(content, int | float):
        raise PageError(f"{what} is not a time: {str(content)[:60]!r}")
    if not 0 <= content <= MAX_UNIX_MS:
        raise PageError(f"{what} is {str(content)[:60]} ms, no time between 1970 and 2200")
    return float(content)


def count(content: Any, what: str) -> int:
    """Return a whole number from 0.

    Raises:
        PageError: it is something else.
    """
    if isinstance(content, bool) or not isinstance(content, int) or not 0 <= content < 10**9:
        raise PageError(f"{what} counts nothing: {str(content)[:60]!r}")
    return content


def ns_of_ms(ms: float) -> int:
    """Return milliseconds of a page's clock in whole nanoseconds."""
    return round(ms * NS_PER_MS)

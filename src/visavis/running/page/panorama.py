"""Panoramas on a page: what it is sent, and what it says of how arrow keys turned the view."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from visavis.running.page.steps import PageError, number
from visavis.stimuli.flat import Panorama
from visavis.stimuli.view_turns import ARROWS, goal_after

MAX_TURNS: Final = 5000
"""Turns of the view in one part; more than anybody presses in it."""
FRAME_MS: Final = (1.0, 1000.0)
"""How long a frame of a browser lasts, at least and at most."""
ROUNDING_DEG: Final = 1e-6


@dataclass(frozen=True)
class PageTurn:
    """A turn of the view as a page says it: the time of the frame that took the key, in ms of the
    page's clock, and from which direction to which, in degrees to the right and upwards.
    """

    at_ms: float
    from_deg: tuple[float, float]
    to_deg: tuple[float, float]


def panorama_on_page(
    panorama: Panorama, files: Callable[[Any], Mapping[str, Any]]
) -> dict[str, Any]:
    """Return a panorama as a page draws it; `files` describes pictures."""
    about = {name: getattr(panorama, name) for name in ("file", "stereo", "yaw_deg", "areas")}
    return about | dict(files(panorama))


def read_panorama(content: Mapping[str, Any]) -> Panorama:
    """Return the panorama of which a page was told."""
    return Panorama(content["file"], content["stereo"], content["yaw_deg"], content["areas"])


def read_turns_of_part(part: Mapping[str, Any]) -> list[PageTurn]:
    """Return how the view turned in a part.

    Raises:
        PageError: the content is malformed.
    """
    rows = part.get("turns")
    if not isinstance(rows, list) or len(rows) > MAX_TURNS:
        raise PageError("turns of a view are a list of [ms, from, to]")
    if any(not isinstance(row, list) or len(row) != 3 for row in rows):
        raise PageError("turns of a view have rows of ms, from and to")
    return [PageTurn(number(ms, "ms"), _direction(a), _direction(b)) for ms, a, b in rows]


def _direction(content: Any) -> tuple[float, float]:
    if not isinstance(content, list) or len(content) != 2:
        raise PageError("a view turns by degrees to the right and upwards")
    right, up = (number(value, "degrees") for value in content)
    return right, up


def frame_ms_of(content: Mapping[str, Any]) -> float:
    """Return how long a frame lasts on a page that shows a panorama.

    Raises:
        PageError: no browser draws so often, or so seldom.
    """
    frame_ms = number(content.get("frame_ms"), "frame_ms")
    if not FRAME_MS[0] <= frame_ms <= FRAME_MS[1]:
        raise PageError(f"frame_ms is {frame_ms}")
    return frame_ms


def check_turns(requests: Sequence[Mapping[str, Any]], parts: Sequence[Mapping[str, Any]]) -> None:
    """Refuse turns of a view that no presses of arrow keys make, for the parts that were asked for.

    Raises:
        PageError: saying what is wrong.
    """
    before_ms = -math.inf
    begin_deg = goal_deg = (0.0, 0.0)
    for request, part in zip(requests, parts, strict=False):
        if "panorama" not in request:
            if "turns" in part:
                raise PageError("only the view onto a panorama turns")
            continue
        if not request.get("goes_on"):
            begin_deg = goal_deg = (0.0, 0.0)
        on_ms, off_ms = number(part.get("on_ms"), "on_ms"), number(part.get("off_ms"), "off_ms")
        for turn in read_turns_of_part(part):
            if not max(before_ms, on_ms) <= turn.at_ms <= off_ms:
                raise PageError(f"a view turned at {turn.at_ms} ms, when it was not seen, or late")
            if turn.to_deg == goal_deg or turn.to_deg not in {
                goal_after(arrow, goal_deg) for arrow in ARROWS
            }:
                raise PageError(f"no key turns a view from {goal_deg} to {turn.to_deg}")
            if not all(map(_is_between, begin_deg, goal_deg, turn.from_deg)):
                raise PageError(f"a view at {turn.from_deg} was not on its way to {goal_deg}")
            before_ms, begin_deg, goal_deg = turn.at_ms, turn.from_deg, turn.to_deg


def _is_between(one: float, other: float, value: float) -> bool:
    return min(one, other) - ROUNDING_DEG <= value <= max(one, other) + ROUNDING_DEG

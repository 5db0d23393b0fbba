"""Participants who arrive at a served study, and where they go afterwards.

A panel names the participant in the address: Prolific as PROLIFIC_PID, STUDY_ID and SESSION_ID,
SONA as survey_code, others as `participant` or `id`. A participant may also come without a panel.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, islice
from typing import Any, Final
from urllib.parse import quote

from visavis.lab.errors import UsageError
from visavis.protocol.plan.session_plan import SessionPlan
from visavis.running.page.steps import PageError

LINK: Final = "link"
"""Name of the panel if a lab's own link names the participant."""
PANELS: Final = {
    "PROLIFIC_PID": "Prolific",
    "survey_code": "SONA",
    "participant": LINK,
    "id": LINK,
}
"""Address parameters that name a participant, and the panel that uses each."""
STORED_PARAMETERS: Final = ("STUDY_ID", "SESSION_ID")
ID: Final = re.compile(r"[A-Za-z0-9_-]{1,64}")
MIN_SECRET: Final = 12
"""Identifiers with this many characters cannot be guessed, unless they are numbers."""
PLACES_AHEAD: Final = 64


@dataclass(frozen=True)
class Arrival:
    """A person who arrived: the panel and its identifier for them, both "" if there is none."""

    panel: str = ""
    identifier: str = ""
    of_panel: Mapping[str, str] | None = None

    @property
    def identity(self) -> dict[str, str]:
        """What the key file stores about them, separately from the data."""
        return {"panel": self.panel, "identifier": self.identifier, **(self.of_panel or {})}

    @property
    def can_be_guessed(self) -> bool:
        """Whether somebody else could name this identifier, too: a number, or a short one."""
        return self.identifier.isdigit() or len(self.identifier) < MIN_SECRET


def arrival_of(parameters: Mapping[str, str]) -> Arrival:
    """Return the arrival that an address's parameters describe.

    Raises:
        PageError: the value is not an identifier, for example a panel's placeholder.
    """
    for name, panel in PANELS.items():
        if name not in parameters:
            continue
        if not ID.fullmatch(parameters[name]):
            raise PageError(
                f"{name}={parameters[name][:40]} is not an identifier (letters, digits, - and _)"
            )
        more = {n: parameters[n] for n in STORED_PARAMETERS if ID.fullmatch(parameters.get(n, ""))}
        return Arrival(panel, parameters[name], more)
    return Arrival()


def completion_of(address: str, arrival: Arrival) -> str:
    """Return the address to open after the study, with "{id}" replaced by the identifier."""
    return address.replace("{id}", quote(arrival.identifier, safe=""))


def check_completion(address: str) -> None:
    """Refuse a completion address that a page must not lead to.

    Raises:
        UsageError: it is not a web address.
    """
    if address and not re.match(r"https?://[^\s/]+", address):
        raise UsageError(f"--completion takes a web address, https://…, not {address!r}")


Order = tuple[Any, ...]


def order_of(plan: SessionPlan, *, trials_too: bool) -> Order:
    """Return what repeats between the plans of people: group, blocks and, in squares, trials."""
    blocks = tuple(block.name for block in plan.blocks)
    trials = tuple(
        tuple(sorted(t.factors.items())) for t in plan.trials if trials_too and not t.is_practice
    )
    return plan.group, blocks, trials


def least_filled(
    taken_places: Iterable[int],
    counting: Sequence[int],
    order: Callable[[int], Order],
    is_open: Callable[[int], bool] = lambda place: True,
) -> int:
    """Return the free place whose order the fewest people have, among those that are open.

    `taken_places` are places already given away, `counting` those of people who completed or are
    taking part: the order of a person who left is filled again. Ties go to the first place.
    """
    places_in_use = set(taken_places)
    free = (index for index in count() if index not in places_in_use)
    people_by_order: dict[Order, int] = {}
    for index in counting:
        people_by_order[order(index)] = people_by_order.get(order(index), 0) + 1
    best, fewest = -1, -1
    ahead = list(islice(free, PLACES_AHEAD))
    for index in [place for place in ahead if is_open(place)] or ahead:
        have = people_by_order.get(order(index), 0)
        if best < 0 or have < fewest:
            best, fewest = index, have
        if not have:
            break
    return best

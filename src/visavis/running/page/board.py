"""The progress of all participants of a served study, read from their sessions on disk."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, Final

import pandas as pd

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import LabError
from visavis.protocol.people.ledger import Participant
from visavis.recording.lock import is_held
from visavis.recording.reader import Recording
from visavis.running.page.course import DECLINED, FILMS_LOADED, FULL, STOPPED, WITHDRAWN
from visavis.running.page.earlier_parts import since_rewinding

ARRIVED: Final = "arrived"
"""State of a participant who has not consented or answered yet, and has no place so far."""
STATES: Final = {
    "complete": "complete",
    "running": "at it",
    ARRIVED: "has not begun",
    "left": "left",
    STOPPED: "stopped, data kept",
    WITHDRAWN: "wants deletion",
    DECLINED: "declined",
    FULL: "came when it was full",
    "deleted": "deleted",
    "damaged": "cannot be read",
    "expected": "has not come",
}
"""States of a participant, and the words that the board shows for them."""
COUNTING: Final = ("complete", "running")
"""States in which a participant has one of the places, and fills their order."""


@dataclass(frozen=True)
class Place:
    """The progress of one participant: trials done and planned, minutes spent, flags of trials.

    `minutes` is None before anything was answered.
    """

    label: str
    index: int
    group: str
    state: str
    trials_done: int = 0
    trials_planned: int = 0
    minutes: float | None = None
    flags: tuple[str, ...] = ()


@dataclass(frozen=True)
class Board:
    """The progress of all participants, and how many are wanted."""

    places: tuple[Place, ...]
    quota: int | None = None

    @property
    def counts(self) -> Mapping[str, int]:
        """How many people are in which state."""
        return Counter(p.state for p in self.places)

    @property
    def median_minutes(self) -> float | None:
        """Median time of complete sessions, None without any."""
        times = [p.minutes for p in self.places if p.state == "complete" and p.minutes is not None]
        return median(times) if times else None

    def as_data(self) -> dict[str, Any]:
        """Return the board as JSON data."""
        return {
            "states": dict(STATES),
            "counts": dict(self.counts),
            "median_minutes": self.median_minutes,
            "quota": self.quota,
            "places": [asdict(p) for p in self.places],
        }


def place_of(entry: Participant, session: Path) -> Place:
    """Return the progress of a participant in the ledger, read from their session's folder."""
    if entry.status != "active":
        return Place(entry.label, entry.index, entry.group, "deleted")
    if not (session / "manifest.json").exists():
        return Place(entry.label, entry.index, entry.group, "expected")
    recording = Recording(session)
    events, trials = recording.events(), recording.trials()
    flags: Counter[str] = Counter()
    trials_done = 0
    if len(trials):
        main_trials = trials[~trials["is_practice"].astype(bool)]
        trials_done = len(main_trials)
        for flag_text in main_trials["flags"].dropna():
            flags.update(filter(None, str(flag_text).split(";")))
    plan = recording.manifest.plan
    planned_count = sum(not t["is_practice"] for b in plan["blocks"] for t in b["trials"])
    times = events.loc[events["name"] == "page_event", "t_ns"]
    minutes = (int(times.max()) - int(times.min())) / NS_PER_S / 60 if len(times) else None
    return Place(
        entry.label,
        entry.index,
        entry.group,
        state_of(recording, events),
        trials_done,
        planned_count,
        minutes,
        tuple(f"{name} ({n})" for name, n in flags.most_common()),
    )


def state_of(recording: Recording, events: pd.DataFrame) -> str:
    """Return how far a session came, one of `STATES`, from its events."""
    if recording.status == "complete":
        return "complete"
    names = events["name"]
    if (names == "stopped").any():
        return WITHDRAWN if asks_for_deletion(events) else STOPPED
    if any(payload["agreed"] is False for payload in events.loc[names == "consent", "payload"]):
        return DECLINED
    if (names == FULL).any():
        return FULL
    if not is_held(recording.path):
        return "left"
    return "running" if has_answered(events) else ARRIVED


def asks_for_deletion(events: pd.DataFrame) -> bool:
    """Tell whether a person stopped, and does not want their data kept."""
    stop_payloads = list(events.loc[events["name"] == "stopped", "payload"])
    return bool(stop_payloads) and not stop_payloads[-1]["keep"]


def has_answered(events: pd.DataFrame) -> bool:
    """Tell whether a person replied, since they were last sent back to the start.

    That gives them a place. A page that loads films replies by itself, once for each loading.
    """
    pages, course, _ = since_rewinding(events.to_dict("records"))
    replies = [payload for _, _, payload in pages if payload["kind"] == "reply"]
    return len(replies) > sum(name == FILMS_LOADED for _, name, _ in course)


def board_of(
    entries: Iterable[Participant],
    folder: Path,
    *,
    quota: int | None = None,
    cached_places: dict[str, Place] | None = None,
    shown_group: Callable[[str], str] = str,
) -> Board:
    """Return the progress of all participants; `shown_group` gives what is read for a group.

    `cached_places` holds, by label, the places that no longer change; new ones are added to it.
    """
    final_places = {} if cached_places is None else cached_places
    places = []
    for entry in entries:
        entry = replace(entry, group=shown_group(entry.group))
        place = final_places.get(entry.label)
        if place is None or entry.status != "active":
            try:
                place = place_of(entry, folder / f"sub-{entry.label}" / "ses-001")
            except LabError:
                place = Place(entry.label, entry.index, entry.group, "damaged")
        if place.state in ("complete", STOPPED, DECLINED, FULL, "deleted"):
            final_places[entry.label] = place
        places.append(place)
    return Board(tuple(places), quota)

"""Somebody's link leads to their next session, once it is due."""

from collections.abc import Mapping
from dataclasses import fields
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from tests.running.page.served_places import Somebody, serve
from visavis.lab.clock import SimClock
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import UsageError
from visavis.protocol.people.ledger import Ledger
from visavis.protocol.session.operator import UnattendedOperator
from visavis.recording.reader import Recording
from visavis.results.opened_study import find_study
from visavis.running.film_store import film_store
from visavis.running.page import client, reception
from visavis.running.page.reception import Reception, Rules
from visavis.running.page.visitor import visitor_of
from visavis.running.sessions.session_request import Request, SessionPerson

STUDY = """
from visavis import Choice, Factor, Study

study = Study("visits", factors=[Factor("side", ["left", "right"])], on="browser", uses=(),
              calibrate=False, sessions=["before", "after"], days_between=(6, 8))

@study.trial
def trial(t):
    yield t.ask(Choice("ease", ["low", "high"]))
"""


class Place:
    """A served study of two sessions."""

    def __init__(self, root: Path) -> None:
        (root / "visits.py").write_text(STUDY, "utf-8")
        self.study: Any = find_study(str(root / "visits.py"))
        self.experiment = self.study.experiment({})
        self.clock = SimClock()
        self.lab = load_config(EXAMPLE).model_copy(
            update={"data_root": root / "data", "key_root": root / "keys", "devices": {}}
        )
        self.folder = self.lab.data_root / "real" / "visits"
        self.folder.mkdir(parents=True)
        self.ledger = Ledger(self.folder, self.clock)
        self.who: dict[str, Mapping[str, str]] = {}
        self.is_full = False
        """Whether somebody else would have found a place at the end of the last visit."""

    def reception(self) -> Reception:
        base = Request(
            study=self.study,
            experiment=self.experiment,
            config=self.lab,
            person=SessionPerson("", 0),
            seed=1,
            clock=self.clock,
            operator=UnattendedOperator(),
            on="browser",
        )
        return Reception(
            base,
            film_store(self.experiment),
            self.ledger,
            Rules(quota=1),
            identify=self.who.__setitem__,
            identity_of=self.who.get,
            forget=lambda label: self.who.pop(label, None),
            withdraw=lambda label: None,
        )

    def comes(self, *, after_days: float, stop: str = "") -> str:
        """Return how a visit by the person's link ended, so long after the first day."""
        first = datetime.fromisoformat(SimClock().wall_iso())
        at_iso = (first + timedelta(days=after_days)).isoformat()
        self.clock.wall_iso = lambda: at_iso  # type: ignore[method-assign]  # another day

        async def come(base: str, reception: Reception) -> str:
            try:
                at = await client.arrive(base, {"participant": "1"})
            except Exception as refusal:
                return str(refusal)
            person = self.study.participant(0, 1, effect=True, experiment=self.experiment)
            made = visitor_of(person, self.experiment, film_store(self.experiment))
            visitor = Somebody(**{f.name: getattr(made, f.name) for f in fields(made) if f.repr})
            visitor.stop = stop
            visitor.now_ms = self.clock.now_ns() / 1e6
            ending = await client.visit(at, visitor, self.clock)
            self.is_full = reception._is_full()
            return ending

        return str(serve(self, come))  # type: ignore[arg-type]  # as much of a place as it needs


@pytest.fixture
def place(tmp_path: Path) -> Place:
    made = Place(tmp_path)
    made.ledger.add(1)
    return made


def test_a_link_leads_to_the_next_session_once_it_is_due(place: Place) -> None:
    assert "done" == place.comes(after_days=0)
    assert "due from 2000-01-07 to 2000-01-09" in place.comes(after_days=2)
    assert "done" == place.comes(after_days=7)
    (first, second) = sorted(place.folder.glob("sub-*/ses-*"))
    rows = [Recording(path).trials() for path in (first, second)]
    assert [{1}, {2}] == [set(one["session"]) for one in rows]
    assert 1 == len(place.ledger.list())
    place.comes(after_days=30)  # all are over: nothing more is asked
    assert 2 == len(sorted(place.folder.glob("sub-*/ses-*")))


def test_who_stops_in_a_later_session_keeps_the_place_of_the_first(place: Place) -> None:
    assert "done" == place.comes(after_days=0)
    assert place.is_full
    assert "stopped" == place.comes(after_days=7, stop="keep")
    assert place.is_full


def test_where_too_many_pages_are_open_a_further_session_waits_too(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "done" == place.comes(after_days=0)
    monkeypatch.setattr(reception, "MAX_OPEN", 0)
    assert "Many people come at this moment" in place.comes(after_days=7)
    assert 1 == len(sorted(place.folder.glob("sub-*/ses-*")))


def test_who_comes_again_while_their_session_is_being_closed_comes_to_that_session(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "done" == place.comes(after_days=0)
    (first,) = place.folder.glob("sub-*/ses-*")

    def before_the_end_is_on_disk(*_: Any) -> Any:
        raise UsageError(f"session 1 (before) is not finished; visavis resume {first}")

    monkeypatch.setattr(reception, "next_session", before_the_end_is_on_disk)
    # From another browser, as nothing is remembered here.
    assert "begun with this address already" in place.comes(after_days=7)
    assert [first] == sorted(place.folder.glob("sub-*/ses-*"))

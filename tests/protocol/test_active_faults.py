"""Faults of devices stay on the operator's screen as long as they matter, and are told once."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from visavis.devices.contracts import Fault
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.protocol.session.active_faults import STALE_NS, ActiveFaults

GONE = Fault("armband", "blocking", "disconnected; reconnecting", "look at its cable")
SILENT = Fault("eye_tracker", "blocking", "silent for 12 s", "look at its cable")
DROPPED = Fault("eye_tracker", "warning", "3 samples were dropped", "close other programs")
UNSEEN = Fault("eye_tracker", "warning", "the left eye is not seen", "move the headset")


class Recorded:
    """Faults of a session that is set up, and the events they left: name, time, what was said."""

    def __init__(self) -> None:
        self.events: list[tuple[str, int, dict[str, Any]]] = []
        recorder: Any = SimpleNamespace(event=lambda n, t_ns, **p: self.events.append((n, t_ns, p)))
        self.faults = ActiveFaults(recorder)

    def shown(self, t_ns: int, *faults: Fault, is_set_up: bool = True) -> list[tuple[str, str]]:
        """Look at a time; return the messages on the operator's screen and how bad they are."""
        self.faults.look(faults, t_ns, is_set_up=is_set_up)
        return [(f.message, f.severity) for f in self.faults.for_screen(t_ns)]


@pytest.mark.parametrize("fault", [GONE, SILENT, UNSEEN], ids=lambda f: f.message)
def test_what_holds_stays_on_the_screen_however_long(fault: Fault) -> None:
    seen = Recorded()
    for t_ns in (0, STALE_NS, 100 * STALE_NS):
        assert [(fault.message, fault.severity)] == seen.shown(t_ns, fault)


def test_a_count_leaves_the_screen_after_ten_seconds_and_is_back_when_it_grows() -> None:
    seen = Recorded()
    more = replace(DROPPED, message="4 samples were dropped")
    assert 10 * NS_PER_S == STALE_NS
    assert [(DROPPED.message, "warning")] == seen.shown(0, DROPPED)
    assert [(DROPPED.message, "warning")] == seen.shown(STALE_NS - 1, DROPPED)
    assert [] == seen.shown(STALE_NS, DROPPED)
    assert [(more.message, "warning")] == seen.shown(STALE_NS + 1, more)
    assert ["fault"] == [name for name, _, _ in seen.events]


def test_what_the_operator_does_without_stays_on_the_screen_as_a_warning() -> None:
    seen = Recorded()
    seen.shown(0, SILENT)
    seen.faults.accepted_absences.add(SILENT.role)
    assert [(SILENT.message, "warning")] == seen.shown(2 * STALE_NS, SILENT)


def test_while_devices_are_set_up_only_what_blocks_is_told() -> None:
    seen = Recorded()
    assert [(GONE.message, "blocking")] == seen.shown(0, UNSEEN, GONE, is_set_up=False)
    assert [GONE.role] == [payload["role"] for _, _, payload in seen.events]
    assert [] == seen.shown(1, is_set_up=False)
    assert ["fault", "fault_over"] == [name for name, _, _ in seen.events]
    assert [(UNSEEN.message, "warning")] == seen.shown(2, UNSEEN)


def test_a_fault_that_is_over_says_how_long_it_lasted_and_its_last_words() -> None:
    seen = Recorded()
    longer = replace(SILENT, message="silent for 14 s")
    seen.shown(1 * NS_PER_S, SILENT)
    seen.shown(3 * NS_PER_S, longer)
    assert NS_PER_S == seen.faults.since_ns(longer)
    seen.shown(4 * NS_PER_S + 500 * NS_PER_MS)
    name, t_ns, payload = seen.events[-1]
    assert ("fault_over", 4_500_000_000) == (name, t_ns)
    assert {"role": "eye_tracker", "message": "silent for 14 s", "lasted_ms": 3500} == payload


@pytest.mark.parametrize(
    ("expected", "fault"), [(True, GONE), (True, SILENT), (True, UNSEEN), (False, DROPPED)]
)
def test_a_trial_is_flagged_for_what_holds_in_it_not_for_what_was_counted_before(
    expected: bool, fault: Fault
) -> None:
    seen = Recorded()
    seen.shown(0, fault)
    seen.shown(5, fault)
    assert expected == seen.faults.concerns(fault, start_ns=1)


def test_a_trial_is_flagged_for_what_is_counted_in_it() -> None:
    seen = Recorded()
    more = replace(DROPPED, message="4 samples were dropped")
    seen.shown(0, DROPPED)
    seen.shown(5, more)
    assert seen.faults.concerns(more, start_ns=1)


def test_a_device_that_is_done_without_is_shown_as_a_warning_until_it_is_back() -> None:
    events: list[str] = []
    recorder: Any = SimpleNamespace(event=lambda name, t_ns, **_: events.append(name))
    faults = ActiveFaults(recorder)
    faults.look((GONE,), 0, is_set_up=True)
    assert ["blocking"] == [fault.severity for fault in faults.for_screen(0)]

    faults.accepted_absences.add("armband")
    faults.look((GONE,), 1, is_set_up=True)
    assert [("armband", "warning")] == [(f.role, f.severity) for f in faults.for_screen(1)]
    assert ["blocking"] == [fault.severity for fault in faults.present]

    faults.look((), 2, is_set_up=True)
    faults.look((GONE,), 3, is_set_up=True)
    assert ["blocking"] == [fault.severity for fault in faults.for_screen(3)]
    assert ["fault", "fault_over", "fault"] == events

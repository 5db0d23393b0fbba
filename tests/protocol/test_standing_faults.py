from types import SimpleNamespace
from typing import Any

from visavis.devices.contracts import Fault
from visavis.protocol.session.active_faults import StandingFaults

GONE = Fault("armband", "blocking", "disconnected; reconnecting", "look at its cable")


def test_a_device_that_is_done_without_is_shown_as_a_warning_until_it_is_back() -> None:
    events: list[str] = []
    recorder: Any = SimpleNamespace(event=lambda name, t_ns, **_: events.append(name))
    faults = StandingFaults(recorder)
    faults.look((GONE,), 0, is_set_up=True)
    assert ["blocking"] == [fault.severity for fault in faults.shown(0)]

    faults.done_without.add("armband")
    faults.look((GONE,), 1, is_set_up=True)
    assert [("armband", "warning")] == [(f.role, f.severity) for f in faults.shown(1)]
    assert ["blocking"] == [fault.severity for fault in faults.present]

    faults.look((), 2, is_set_up=True)
    faults.look((GONE,), 3, is_set_up=True)
    assert ["blocking"] == [fault.severity for fault in faults.shown(3)]
    assert ["fault", "fault_over", "fault"] == events

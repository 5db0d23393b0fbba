"""Active device faults. Each is reported once, even when its numbers change."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from visavis.devices.contracts import Fault
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.recording.writer import Recorder

STALE_NS = 10 * NS_PER_S
"""A warning whose numbers have not changed for this long leaves the operator's screen."""

_FIGURES = re.compile(r"[0-9]+")


@dataclass
class _ActiveFault:
    """An active fault: since when, its present message, and since when it has that message."""

    since_ns: int
    message: str
    changed_ns: int
    is_reported: bool = False


class ActiveFaults:
    """Record faults when they come and when they are over.

    `present` are those of the last look; `accepted_absences` the roles whose absence the operator
    accepted, until they are back.
    """

    def __init__(self, recorder: Recorder) -> None:
        self.present: tuple[Fault, ...] = ()
        self.accepted_absences: set[str] = set()
        self._recorder = recorder
        self._active: dict[tuple[str, str], _ActiveFault] = {}

    def report(self, fault: Fault, t_ns: int, *, is_set_up: bool) -> None:
        """Record a fault once; a warning only when the devices have been set up."""
        key = _key(fault)
        active = self._active.get(key)
        if active is None:
            active = self._active[key] = _ActiveFault(t_ns, fault.message, t_ns)
        elif active.message != fault.message:
            active.message, active.changed_ns = fault.message, t_ns
        if not active.is_reported and (is_set_up or fault.severity == "blocking"):
            active.is_reported = True
            self._recorder.event(
                "fault",
                t_ns,
                role=fault.role,
                severity=fault.severity,
                message=fault.message,
                remedy=fault.remedy,
            )

    def look(self, faults: Sequence[Fault], t_ns: int, *, is_set_up: bool) -> None:
        """Take the faults there are now, and record which are over."""
        self.present = tuple(faults)
        for fault in self.present:
            self.report(fault, t_ns, is_set_up=is_set_up)
        holding = {_key(f) for f in self.present}
        for key in [k for k in self._active if k not in holding]:
            over = self._active.pop(key)
            if over.is_reported:
                self._recorder.event(
                    "fault_over",
                    t_ns,
                    role=key[0],
                    message=over.message,
                    lasted_ms=round((t_ns - over.since_ns) / NS_PER_MS),
                )
        # one blocking fault may give way to another: silent first, then known to be gone
        self.accepted_absences &= {f.role for f in self.present if f.severity == "blocking"}

    def blocking(self) -> tuple[Fault, ...]:
        """Return the faults that keep a trial from running."""
        return tuple(
            f
            for f in self.present
            if f.severity == "blocking" and f.role not in self.accepted_absences
        )

    def since_ns(self, fault: Fault) -> int:
        """Return the session time since which a present fault has been active."""
        return self._active[_key(fault)].since_ns

    def concerns(self, fault: Fault, start_ns: int) -> bool:
        """Tell whether a fault concerns the time since then, not a count from before it."""
        is_count = fault.severity == "warning" and _FIGURES.search(fault.message)
        return not is_count or self._active[_key(fault)].changed_ns > start_ns

    def for_screen(self, t_ns: int) -> tuple[Fault, ...]:
        """Return the faults for the operator's screen; accepted absences become warnings."""
        return tuple(
            replace(f, severity="warning") if f.role in self.accepted_absences else f
            for f in self.present
            if self._is_fresh(f, t_ns)
        )

    def _is_fresh(self, fault: Fault, t_ns: int) -> bool:
        active = self._active[_key(fault)]
        if not active.is_reported:
            return False
        if fault.severity == "blocking" or not _FIGURES.search(fault.message):
            return True
        return t_ns - active.changed_ns < STALE_NS


def _key(fault: Fault) -> tuple[str, str]:
    return fault.role, _FIGURES.sub("#", fault.message)

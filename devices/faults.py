"""Faults of a wire, scheduled in session time, from a list, a file or a seed."""

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np

FAULT_KINDS: Mapping[str, str] = {
    "late_start": "nobody answers and nothing comes until the window ends",
    "silence": "no samples; requests are answered",
    "loss": "amount = share of samples that never arrive",
    "duplicate": "amount = share of samples that arrive twice",
    "reorder": "amount = share of samples that arrive two periods late",
    "burst": "samples are held back and all arrive when the window ends",
    "clock_jump": "amount = seconds the device clock jumps by at the start, for good",
    "backward": "amount = seconds the device's stamps step back by, within the window",
    "drift": "amount = ppm the device clock runs fast by, from the start on",
    "eyes_lost": "eyes = both, left or right: not seen within the window",
    "disconnect": "the peer is gone within the window and returns",
    "version": "text = version the device claims to be",
    "mute": "the peer accepts requests and never answers; samples go on",
    "garbage": "amount = share of messages whose bytes are noise",
    "notify": "text = subject of a notification sent at the start",
    "standby": "headset, body tracker: poses are invalid within the window",
    "frozen": "body tracker: poses stand still within the window",
    "part_lost": "body tracker: text = segment that is not tracked within the window",
    "part_frozen": "body tracker: text = segment that repeats its last pose within the window",
}
"""Kind of fault -> what it does."""

EYES = ("both", "left", "right")
SHARES = frozenset({"loss", "duplicate", "reorder", "garbage"})
TEXTS = frozenset({"version", "notify", "part_lost", "part_frozen"})


@dataclass(frozen=True)
class WireFault:
    """One fault: `kind` from `FAULT_KINDS`, within [start, start + duration) of session time."""

    kind: str
    start_s: float = 0.0
    duration_s: float = float("inf")
    amount: float = 0.0
    eyes: str = "both"
    text: str = ""

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            near = difflib.get_close_matches(self.kind, FAULT_KINDS, n=1, cutoff=0.4)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ConfigError(f"unknown fault {self.kind!r}{hint} Known: {', '.join(FAULT_KINDS)}")
        if not (self.start_s >= 0 and self.duration_s >= 0):
            raise ConfigError(f"fault {self.kind!r}: start_s and duration_s must be at least 0")
        if self.kind in SHARES and not 0 <= self.amount <= 1:
            raise ConfigError(f"fault {self.kind!r}: amount is a share from 0 to 1")
        if self.kind in TEXTS and not self.text:
            raise ConfigError(f"fault {self.kind!r} needs a text: {FAULT_KINDS[self.kind]}")
        if self.eyes not in EYES:
            raise ConfigError(f"fault {self.kind!r}: eyes is one of {', '.join(EYES)}")

    @property
    def start_ns(self) -> int:
        """Start in ns of session time."""
        return round(self.start_s * NS_PER_S)

    @property
    def end_ns(self) -> int:
        """End in ns of session time; a very large number when it never ends."""
        end_s = self.start_s + self.duration_s
        return round(end_s * NS_PER_S) if math.isfinite(end_s) else 2**62


@dataclass(frozen=True)
class FaultSchedule:
    """The faults of one simulated device; empty means a perfect wire."""

    faults: tuple[WireFault, ...] = ()

    @classmethod
    def from_config(cls, rows: Sequence[Mapping[str, Any]]) -> "FaultSchedule":
        """Build from dictionaries with the fields of `WireFault`; all errors at once."""
        faults: list[WireFault] = []
        problems: list[str] = []
        names = tuple(WireFault.__dataclass_fields__)
        for number, row in enumerate(rows, start=1):
            unknown = [key for key in row if key not in names]
            if unknown:
                near = difflib.get_close_matches(unknown[0], names, n=1, cutoff=0.4)
                hint = f"; did you mean {near[0]!r}?" if near else f"; known: {', '.join(names)}"
                problems.append(f"fault {number}: unknown key {unknown[0]!r}{hint}")
                continue
            try:
                faults.append(WireFault(**row))
            except ConfigError as problem:
                problems.append(f"fault {number}: {problem}")
            except TypeError as problem:
                problems.append(f"fault {number}: wrong or missing value: {problem}")
        if problems:
            raise ConfigError("; ".join(problems))
        return cls(tuple(faults))

    @classmethod
    def random(cls, rng: "np.random.Generator", session_s: float) -> "FaultSchedule":
        """Draw an eventful session: losses throughout, a few windows of everything else."""

        def window(kind: str, longest_s: float, amount: float = 0.0) -> WireFault:
            duration_s = float(rng.uniform(0.1, longest_s))
            start_s = float(rng.uniform(0, max(0.0, session_s - duration_s)))
            return WireFault(kind, start_s, duration_s, amount)

        return cls(
            (
                WireFault("loss", amount=float(rng.uniform(0.01, 0.05))),
                WireFault("drift", amount=float(rng.uniform(-50, 50))),
                window("silence", 1.5),
                window("burst", 1.0),
                window("duplicate", 5.0, 0.2),
                window("reorder", 5.0, 0.2),
                window("garbage", 5.0, 0.1),
                window("backward", 0.5, 0.02),
                window("eyes_lost", 2.0),
                window("disconnect", 3.0),
            )
        )

    def active(self, kind: str, t_ns: int) -> WireFault | None:
        """Return the first fault of this kind in force at this session time, or None."""
        for fault in self.faults:
            if fault.kind == kind and fault.start_ns <= t_ns < fault.end_ns:
                return fault
        return None

    def of_kind(self, kind: str) -> tuple[WireFault, ...]:
        """Return every fault of one kind, in the order given."""
        return tuple(fault for fault in self.faults if fault.kind == kind)

    def clock_error_ns(self, t_ns: int) -> int:
        """Return what drifts and jumps have added to the device's clock by this session time."""
        error_ns = 0
        for fault in self.of_kind("drift"):
            error_ns += round(max(0, t_ns - fault.start_ns) * fault.amount * 1e-6)
        for fault in self.of_kind("clock_jump"):
            if t_ns >= fault.start_ns:
                error_ns += round(fault.amount * NS_PER_S)
        return error_ns

"""The condition of an armband as its driver knows it, and its faults for the operator."""

from dataclasses import dataclass, field

from visavis.devices.contracts import Fault
from visavis.devices.drivers.armband import codec

FULL_MV = 4150
EMPTY_MV = 3300
LOW_01 = 0.2

DEAD_MAN, EXPIRED, BATTERY_LOW, BATTERY_GOOD, HOT, COOL = 2, 3, 4, 5, 6, 7
MOTORS_REST, MOTORS_RESTED, HELD_TOO_LONG, SENSOR_LOST = 9, 10, 11, 12
REMEDIES = {
    codec.BATTERY_EMPTY: "charge it",
    codec.DISAGREED: "charge it",
    codec.RESTING: "let the study vibrate less: docs/armbands.md tells how long a motor may run",
    codec.HELD: "let the study end a setting, or change it, before it has held for 20 s",
    codec.BLIND: "check the thermistor on the strap and its cable",
}


UNANSWERED_TEXT = "commands were not acknowledged"
"""Fault text for commands given up; a replay has some, as its last commands differ."""


@dataclass
class BandStatus:
    """Counts and states since `open`."""

    role: str
    battery_01: float | None = None
    temperature_c: float | None = None
    tells_skin: bool = False
    """`temperature_c` is the skin's, not the processor's."""
    resting: int = 0
    battery_is_low: bool = False
    is_hot: bool = False
    loop_stalled: bool = False
    unanswered_count: int = 0
    dead_man_fired: int = 0
    refusals: dict[int, int] = field(default_factory=dict)

    def take_report(self, answer: codec.Acknowledgement) -> None:
        """Take battery and temperature from an answer to PING."""
        if answer.battery_mv is not None:
            self.battery_01 = charge_01(answer.battery_mv)
        if answer.temperature_c is not None:
            self.temperature_c = answer.temperature_c

    def take_event(self, event: codec.BandEvent) -> None:
        """Take an event of the band."""
        if event.code == DEAD_MAN:
            self.dead_man_fired += 1
        elif event.code in (BATTERY_LOW, BATTERY_GOOD):
            self.battery_is_low = event.code == BATTERY_LOW
            self.battery_01 = charge_01(event.value)
        elif event.code in (HOT, COOL):
            self.is_hot = event.code == HOT
        elif event.code in (MOTORS_REST, MOTORS_RESTED):
            self.resting = event.value

    def count_refusal(self, status: int) -> None:
        """Count a command that the band did not carry out."""
        self.refusals[status] = self.refusals.get(status, 0) + 1

    def faults(self, unreadable_count: int) -> tuple[Fault, ...]:
        """Return the faults that the operator must know."""
        role, faults = self.role, []
        if self.is_hot:
            faults.append(Fault(role, "blocking", "too hot: it refuses to run", "take it off"))
        if self.resting:
            motors = ", ".join(str(m + 1) for m in range(8) if self.resting >> m & 1)
            text = f"motors that rest, their time being used up: {motors}"
            faults.append(Fault(role, "warning", text, REMEDIES[codec.RESTING]))
        if self.battery_is_low or (self.battery_01 is not None and self.battery_01 < LOW_01):
            charge = "" if self.battery_01 is None else f" ({self.battery_01:.0%})"
            faults.append(Fault(role, "warning", f"battery low{charge}", "charge it at the break"))
        if self.loop_stalled:
            text = "silenced because the experiment loop stood still"
            faults.append(Fault(role, "warning", text, "close other programs on this computer"))
        if self.dead_man_fired:
            text = f"silenced itself {self.dead_man_fired} times because no command came"
            faults.append(Fault(role, "warning", text, "bring the band nearer, check its cable"))
        if self.unanswered_count:
            text = f"{self.unanswered_count} {UNANSWERED_TEXT}"
            faults.append(Fault(role, "warning", text, "bring the band nearer, check its cable"))
        for status, count in sorted(self.refusals.items()):
            status_text = (
                codec.STATUS_TEXTS[status]
                if status < len(codec.STATUS_TEXTS)
                else f"status {status}"
            )
            if status != codec.TOO_HOT:
                remedy = REMEDIES.get(status, "report this")
                faults.append(Fault(role, "warning", f"{count} commands {status_text}", remedy))
        if unreadable_count:
            text = f"{unreadable_count} messages could not be read"
            faults.append(Fault(role, "warning", text, "keep the .wire log and report it"))
        return tuple(faults)


def charge_01(battery_mv: int) -> float:
    """Return the charge of a Li-ion cell by its voltage, a straight line between its ends."""
    return min(1.0, max(0.0, (battery_mv - EMPTY_MV) / (FULL_MV - EMPTY_MV)))

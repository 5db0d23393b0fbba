"""Hold a device's state and refuse calls that do not fit it, naming both."""

from collections.abc import Sequence

from visavis.devices.contracts import ClockPair, DeviceState, Sink
from visavis.lab.errors import DeviceError


class Lifecycle:
    """The state of one device."""

    def __init__(self, role: str) -> None:
        self._role = role
        self.state = DeviceState.CLOSED

    def require(self, method: str, *allowed: DeviceState) -> None:
        """Raise DeviceError unless the state is one of those allowed."""
        if self.state not in allowed:
            states_text = " or ".join(state.value for state in allowed)
            raise DeviceError(
                f"{method}() needs the device {states_text}, but it is {self.state.value}",
                role=self._role,
                remedy="call open() and start() in this order",
            )


class HasLife:
    """The common part of devices that keep their state in a `Lifecycle`."""

    _life: Lifecycle
    _sink: Sink | None

    @property
    def state(self) -> DeviceState:
        """The state of its life; FAULT while the driven device is away."""
        return self._life.state

    def stop(self) -> None:
        """Stop delivering; what it is reached by stays open."""
        self._life.require("stop", DeviceState.STREAMING, DeviceState.FAULT)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def clock_pairs(self) -> Sequence[ClockPair]:
        """Return nothing: no times are exchanged with a clock of its own, if it has one."""
        return ()


class OnSessionClock(HasLife):
    """A device with nothing to connect to and no clock of its own."""

    def open(self, deadline_s: float) -> None:
        """Become ready."""
        self._life.require("open", DeviceState.CLOSED)
        self._life.state = DeviceState.OPEN

    def stop(self) -> None:
        """Stop delivering."""
        self._life.require("stop", DeviceState.STREAMING)
        self._sink = None
        self._life.state = DeviceState.OPEN

    def close(self) -> None:
        """Deliver no more; idempotent."""
        self._sink = None
        self._life.state = DeviceState.CLOSED

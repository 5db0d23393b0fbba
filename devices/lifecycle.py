"""Hold a device's state and refuse calls that do not fit it, naming both."""

from devices.contracts import DeviceState
from lab.errors import DeviceError


class Lifecycle:
    """The state of one device."""

    def __init__(self, role: str) -> None:
        self._role = role
        self.state = DeviceState.CLOSED

    def require(self, method: str, *allowed: DeviceState) -> None:
        """Raise DeviceError unless the state is one of those allowed."""
        if self.state not in allowed:
            wanted = " or ".join(state.value for state in allowed)
            raise DeviceError(
                f"{method}() needs the device {wanted}, but it is {self.state.value}",
                role=self._role,
                remedy="call open() and start() in this order",
            )

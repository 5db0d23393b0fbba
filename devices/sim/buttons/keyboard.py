"""A keyboard whose keys a simulated body presses, as the participant's window reports them."""

from visavis.devices.sim.buttons.presses import PressingPeer


class PressedKeys(PressingPeer):
    """Tell presses and releases as lines."""

    def message(self, button: str, value_01: float, t_ns: int) -> bytes:
        """Return a line: "+" pressed, "-" released, and the key's name."""
        return (b"+" if value_01 > 0.5 else b"-") + button.encode() + b"\n"

"""Vicon Tracker: its options and its description."""

from typing import Any, Literal

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

REMEDY = (
    "in Tracker's output settings switch the UDP object stream on, with this computer's address "
    "and port, and let UDP through the firewall"
)


class ViconOptions(StreamOptions):
    """Options of `vicon`: the port Tracker sends to, and its objects -> segments.

    `rate_hz` is Tracker's frame rate: frames are numbered and bear no time.
    """

    of_wire = frozenset({"port"})

    port: int = Field(default=51001, ge=1, le=65535)
    bodies: dict[str, str] = Field(default_factory=dict)
    rate_hz: float = Field(default=100.0, ge=1, le=2000)
    up: Literal["+Z", "+Y"] = "+Z"
    yaw_deg: float = Field(default=0.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True})

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift, the objects that move and the axis that points upwards."""
        return {**super().for_simulator(), "bodies": self.bodies, "up": self.up}


VICON = DriverSpec(
    name="vicon",
    kind="body tracker",
    options=ViconOptions,
    product=Product(vendor="Vicon", model="Tracker"),
    wire=Wire(medium="UDP", listens=("UDP {port}",), binds="port"),
    remedy=REMEDY,
    claims=Claims(
        stands_for="Vicon Tracker 3 and 4, objects of its UDP stream",
        checked="layout and rotations as three public clients read them; UDP",
        unproven="any Tracker: what it sends of an object that is not seen",
    ),
)
SPECS = (VICON,)

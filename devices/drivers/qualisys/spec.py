"""Qualisys Track Manager: its options and its description."""

from typing import Any

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

REMEDY = (
    "start QTM's preview or a measurement, switch real-time output on with its 6DOF bodies, and "
    "let TCP 22223 through the firewall"
)


class QualisysOptions(StreamOptions):
    """Options of `qualisys`: QTM's computer, and its 6DOF bodies -> segments."""

    of_wire = frozenset({"address", "port"})

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=22223, ge=1, le=65535)
    bodies: dict[str, str] = Field(default_factory=dict)
    rate_hz: float = Field(default=100.0, ge=1, le=2000)
    yaw_deg: float = Field(default=0.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True})

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and the bodies that move."""
        return {**super().for_simulator(), "bodies": self.bodies}


QUALISYS = DriverSpec(
    name="qualisys",
    kind="body tracker",
    options=QualisysOptions,
    product=Product(vendor="Qualisys", model="QTM"),
    wire=Wire(medium="TCP", dials=True),
    remedy=REMEDY,
    claims=Claims(
        stands_for="Qualisys Track Manager, 6DOF bodies",
        checked="the vendor's own client qtm-rt reads our simulator; TCP",
        unproven="any QTM: order of a rotation's numbers, disabled bodies, skeletons",
    ),
)
SPECS = (QUALISYS,)

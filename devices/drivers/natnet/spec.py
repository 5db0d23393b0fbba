"""OptiTrack Motive: its options and its description."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

MOTIVE_BONES: Mapping[str, str] = {
    "Hip": "hips",
    "Ab": "spine",
    "Chest": "upper_chest",
    "Neck": "neck",
    "Head": "head",
    **{
        f"{letter}{bone}": f"{side}_{part}"
        for letter, side in (("L", "left"), ("R", "right"))
        for bone, part in {
            "Shoulder": "shoulder",
            "UArm": "upper_arm",
            "FArm": "lower_arm",
            "Hand": "hand",
            "Thigh": "upper_leg",
            "Shin": "lower_leg",
            "Foot": "foot",
            "Toe": "toes",
        }.items()
    },
}
"""Motive's names of a skeleton's bones -> ours."""


class NatNetOptions(StreamOptions):
    """Options of `natnet`: Motive's computer; without a group the stream is unicast."""

    of_wire = frozenset({"address", "port", "multicast_group", "data_port", "local_address"})

    address: str = Field(default="127.0.0.1", min_length=1)
    port: int = Field(default=1510, ge=1, le=65535)
    multicast_group: str = "239.255.42.99"
    data_port: int = Field(default=1511, ge=1, le=65535)
    local_address: str = ""
    """This computer's address on Motive's network; needed where it has several."""
    bodies: dict[str, str] = Field(default_factory=dict)
    skeleton: str = ""
    yaw_deg: float = Field(
        default=180.0, ge=-360, le=360, json_schema_extra={"any_magnitude": True}
    )

    def for_simulator(self) -> dict[str, Any]:
        """Return rate, drift and what moves: the bodies named, or a skeleton."""
        skeleton = "" if self.bodies else self.skeleton or "Participant"
        bodies = self.bodies or MOTIVE_BONES
        return {**super().for_simulator(), "bodies": bodies, "skeleton": skeleton}


NATNET = DriverSpec(
    name="natnet",
    kind="body tracker",
    options=NatNetOptions,
    product=Product(vendor="OptiTrack", model="Motive"),
    wire=Wire(medium="UDP", listens=("UDP {data_port}",), binds="data_port"),
    remedy=(
        "in Motive's streaming settings switch streaming on, with rigid bodies or skeletons "
        "and y up, choose this network, and let UDP 1510 and 1511 through the firewall"
    ),
    claims=Claims(
        stands_for="OptiTrack Motive 2.0 and later (NatNet 3.0–4.2)",
        checked="our reading of the vendor's SDK; numbers that a Motive 2.1 sent; UDP",
        unproven="any Motive; multicast",
    ),
)
SPECS = (NATNET,)

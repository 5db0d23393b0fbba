"""Xsens MVN: its options and its description."""

from pydantic import Field

from visavis.devices.options import StreamOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire


class XsensOptions(StreamOptions):
    """Options of `xsens`: the port MVN sends to, and which of its characters, if there are more."""

    of_wire = frozenset({"port"})

    port: int = Field(default=9763, ge=1, le=65535)
    rate_hz: float = Field(default=240.0, ge=1, le=2000)
    character: int | None = Field(default=None, ge=0, le=255)


XSENS = DriverSpec(
    name="xsens",
    kind="body tracker",
    options=XsensOptions,
    product=Product(vendor="Movella", model="Xsens MVN"),
    wire=Wire(medium="UDP", listens=("UDP {port}",), binds="port"),
    remedy=(
        "in MVN's network streamer add this computer and port, choose Position + Orientation "
        "(Quaternion), and let UDP through the firewall"
    ),
    claims=Claims(
        stands_for="Xsens MVN",
        checked="our reading of the vendor's document and public parsers; UDP",
        unproven="MVN's axes per message type",
    ),
)
SPECS = (XSENS,)

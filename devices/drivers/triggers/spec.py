"""Triggers out: options and descriptions."""

from typing import Any

from pydantic import Field, field_validator

from visavis.devices.drivers.links.options import SerialOptions
from visavis.devices.libraries import LSL, SERIAL, USB
from visavis.devices.options import SimulatedOptions
from visavis.devices.spec import Claims, DriverSpec, Product, Wire

LABJACK_VID, U3_PID = 0x0CD5, 0x0003


class TriggerOptions(SimulatedOptions):
    """Which code, 1 to 255, stands for which mark; how long it stands, and the rest after it."""

    codes: dict[str, int] = Field(min_length=1)
    width_ms: float = Field(default=5.0, ge=0.1, le=1000)
    settle_ms: float = Field(default=2.0, ge=0, le=1000)

    @field_validator("codes")
    @classmethod
    def _fit(cls, codes: dict[str, int]) -> dict[str, int]:
        wrong = {mark: code for mark, code in codes.items() if not 1 <= code <= 255}
        if wrong:
            mark, code = next(iter(wrong.items()))
            raise ValueError(f"{mark}: {code} is not a code: eight lines hold 1 to 255")
        return codes

    def for_trigger(self) -> dict[str, Any]:
        """Return the driver's arguments besides role, wire and clock."""
        return {"codes": self.codes, "width_ms": self.width_ms, "settle_ms": self.settle_ms}


class SerialTriggerOptions(TriggerOptions, SerialOptions):
    """Options of `serial_triggers`."""

    baud: int = Field(default=115_200, ge=1200, le=3_000_000)


class XidTriggerOptions(SerialTriggerOptions):
    """Options of `xid_triggers`; a pulse's width is whole milliseconds."""

    width_ms: float = Field(default=5.0, ge=1, le=1000, multiple_of=1)


class ParallelTriggerOptions(TriggerOptions):
    """Options of `parallel_triggers`: "/dev/parport0", or on Windows an address, "0x378"."""

    port: str = "/dev/parport0"


class LabJackTriggerOptions(TriggerOptions):
    """Options of `labjack_triggers`; `pid` 3 is a U3, 6 a U6."""

    vid: int = Field(default=LABJACK_VID, ge=0, le=0xFFFF)
    pid: int = Field(default=U3_PID, ge=0, le=0xFFFF)
    serial_number: str = ""


class LslTriggerOptions(TriggerOptions):
    """Options of `lsl_triggers`: what the stream is called."""

    stream_name: str = "visavis triggers"
    source_id: str = "visavis-triggers"


SERIAL_TRIGGERS = DriverSpec(
    name="serial_triggers",
    kind="triggers",
    options=SerialTriggerOptions,
    product=Product(model="serial trigger box"),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    remedy="plug the box in; `visavis doctor` lists what is plugged in",
    claims=Claims(
        stands_for="trigger boxes on a serial port: a byte sets eight lines, 0 clears them",
        checked="our reading of such boxes' manuals; pyserial on a pseudo-terminal",
        unproven="any box: its delay, and whether it clears its lines by itself",
    ),
)
XID_TRIGGERS = DriverSpec(
    name="xid_triggers",
    kind="triggers",
    options=XidTriggerOptions,
    product=Product(vendor="Cedrus", model="c-pod, m-pod or StimTracker"),
    wire=Wire(medium="serial port", carries="bytes", library=SERIAL),
    remedy="plug the unit in, switch it to XID mode; `visavis doctor` lists what is plugged in",
    claims=Claims(
        stands_for="Cedrus c-pod, m-pod, StimTracker: output lines by XID",
        checked="bytes compared with the vendor's own client pyxid2",
        unproven="a unit: its delay, the width of its pulses",
    ),
)
PARALLEL_TRIGGERS = DriverSpec(
    name="parallel_triggers",
    kind="triggers",
    options=ParallelTriggerOptions,
    product=Product(vendor="IEEE 1284", model="parallel port"),
    wire=Wire(medium="parallel port", carries="bytes"),
    remedy="see docs/eeg.md: the port's driver, its address, the group lp",
    claims=Claims(
        stands_for="parallel port, lines D0 to D7",
        checked="requests to the kernel compared with pyparallel's; inpoutx64 by our reading",
        unproven="a port with its kernel driver; any card",
    ),
)
LABJACK_TRIGGERS = DriverSpec(
    name="labjack_triggers",
    kind="triggers",
    options=LabJackTriggerOptions,
    product=Product(vendor="LabJack", model="U3 or U6"),
    wire=Wire(medium="USB", carries="bytes", library=USB),
    remedy="plug the LabJack in; on Linux, visavis devices rules",
    claims=Claims(
        stands_for="LabJack U3 and U6, lines EIO0 to EIO7",
        checked="packets compared with LabJackPython's",
        unproven="a unit: endpoints, delay over USB",
    ),
)
LSL_TRIGGERS = DriverSpec(
    name="lsl_triggers",
    kind="triggers",
    options=LslTriggerOptions,
    product=Product(model="LSL markers"),
    wire=Wire(medium="LSL", carries="bytes", library=LSL),
    remedy="install pylsl, and look for the stream in LabRecorder",
    claims=Claims(
        stands_for="LSL markers for any recorder",
        checked="received by pylsl's own inlet",
        unproven="other recorders",
    ),
)
SPECS = (SERIAL_TRIGGERS, XID_TRIGGERS, PARALLEL_TRIGGERS, LABJACK_TRIGGERS, LSL_TRIGGERS)

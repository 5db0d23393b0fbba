"""HID eye trackers: their driver on USB, and their simulator."""

from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.hid_gaze.reports import HidReports
from visavis.devices.drivers.hid_gaze.spec import HID_GAZE
from visavis.devices.sim.hid_gaze import HidGazeSimulator
from visavis.devices.wiring import Wiring, driven_by, streamed_by, wired_by

WIRINGS = (
    Wiring(
        HID_GAZE,
        make=driven_by(HidGaze),
        real=wired_by(HidReports, "serial"),
        simulated=streamed_by(HidGazeSimulator),
    ),
)

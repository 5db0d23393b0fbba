"""What devices say of themselves: bounds, and the pace of their clocks."""

import numpy as np
import pytest

from tests.devices.gaze_rigs import GazeRig
from visavis.devices.drivers.hid_gaze.driver import HidGaze
from visavis.devices.drivers.lsl.gaze_codec import StreamInfo, require_rate
from visavis.devices.plausible import (
    SAMPLES_PER_S,
    SCREEN_SIDE_MM,
    TICKS_PER_S,
    VIBRATION_HZ,
    ClockPace,
)
from visavis.devices.sim.hid_gaze import HidGazeSimulator
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import ProtocolViolation

EACH = [SAMPLES_PER_S, SCREEN_SIDE_MM, TICKS_PER_S, VIBRATION_HZ]


@pytest.mark.parametrize("bounds", EACH, ids=lambda bounds: bounds.unit)
@pytest.mark.parametrize("value", [0.0, -1.0, 1e300, float("nan"), float("inf")])
def test_bounds_admit_nothing_negative_endless_or_missing(bounds, value):
    assert not bounds.admit(value)


def test_refusal_names_the_number_and_its_bounds():
    text = TICKS_PER_S.sentence("the clock", 4.7e18)

    assert text == "the clock is said to be 4.7e+18 ticks/s, but can only be 1000 to 1e+10 ticks/s"


def pace_of(device_ns, host_ns):
    pace = ClockPace()
    for device, host in zip(device_ns.tolist(), host_ns.tolist(), strict=True):
        pace.add(device, host)
    return pace.wrong()


HOST_NS = np.arange(0, 10 * NS_PER_S, NS_PER_S // 100)


@pytest.mark.parametrize("pace", [7e-9, 0.333, 0.9, 1.1, 10.0, 1000.0])
def test_clock_of_another_unit_is_told_by_its_pace(pace):
    assert pace_of((HOST_NS * pace).astype(np.int64), HOST_NS) == pytest.approx(pace, rel=0.02)


@pytest.mark.parametrize("drift_ppm", [-1000, 0, 1000])
def test_clock_of_any_oscillator_passes(drift_ppm):
    assert pace_of((HOST_NS * (1 + drift_ppm * 1e-6)).astype(np.int64), HOST_NS) is None


def test_jump_and_stretch_held_back_are_no_wrong_pace():
    jumping_ns = HOST_NS + 3600 * NS_PER_S * (HOST_NS > 4 * NS_PER_S)
    held_ns = np.where((HOST_NS > 3 * NS_PER_S) & (HOST_NS < 5 * NS_PER_S), 5 * NS_PER_S, HOST_NS)

    assert pace_of(jumping_ns, HOST_NS) is None
    assert pace_of(HOST_NS, held_ns) is None


@pytest.mark.parametrize("rate_hz", [-5.0, 1e12, float("inf"), float("nan")])
def test_implausible_rate_of_a_stream_is_refused(rate_hz):
    with pytest.raises(ProtocolViolation, match="rate of the stream 'eeg' is said to be"):
        require_rate(StreamInfo("eeg", "", rate_hz, 1, ()))


def test_irregular_stream_has_no_rate_and_is_accepted():
    require_rate(StreamInfo("marks", "", 0.0, 1, ()))


def test_unit_taken_from_a_wrong_rate_blocks():
    """HID trackers do not say the unit of their stamps, which follows from the rate."""
    rig = GazeRig(HidGaze, HidGazeSimulator, rate_hz=120.0, options={"rate_hz": 12.0})
    rig.start().run(6.0)

    assert "its clock counts 10 s in 1 s of this computer" in rig.messages()


def test_screen_of_no_size_is_named_and_not_used():
    rig = GazeRig(HidGaze, HidGazeSimulator)
    rig.start()

    rig.driver._take_size(0.5, 300.0)

    assert rig.driver._screen.width_mm != 0.5
    assert "the screen's width is said to be 0.5 mm" in rig.messages()

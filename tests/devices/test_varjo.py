"""Varjo's native library: the layout a C compiler gives the header's structures, and its calls."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.varjo_library import VarjoStandIn, built_library
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.varjo import codec
from visavis.devices.drivers.varjo.driver import Varjo
from visavis.devices.drivers.varjo.library import VarjoLibrary
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.varjo import VarjoSimulator
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DeviceNotFound


@pytest.fixture(scope="module")
def stand_in():
    if find_compiler() is None:
        pytest.skip("the stand-in needs a C compiler: apt-get install gcc")
    return VarjoStandIn(built_library())


def datum(
    frame=7,
    captured_ns=1234,
    *,
    ray=(0.0, 0.0, 1.0),
    states=(3, 3),
    status=2,
    pupils=(3.5, 4.0),
    openness=(0.9, 0.8),
    measured_frame=None,
):
    """One datum by the header's order: eyes 32 mm beside the middle, all looking along `ray`."""
    rays = [v for x in (-0.032, 0.032, 0.0) for v in (x, 0.01, 0.02, *ray)]
    gaze = struct.pack("<18d2d5q2d", *rays, 1.5, 0.5, captured_ns, *states, status, frame, 0, 0)
    frame = frame if measured_frame is None else measured_frame
    ratios, irises = (0.3, 0.35), (11.7, 11.8)
    eyes = struct.pack("<2q9f4x", frame, captured_ns, 63.5, *ratios, *pupils, *irises, *openness)
    return gaze + eyes


def row_of(payload):
    return rows_to_values([codec.decode_datum(payload).row])[0]


def test_the_codec_reads_where_the_compiler_puts_the_headers_members(stand_in):
    ray = 48
    expected = [216, 56, ray, 2 * ray + 24, 3 * ray + 16, 3 * ray + 16 + 32, 16 + 12, 16 + 28]
    assert stand_in.layout() == expected
    assert (codec.GAZE.size, codec.MEASUREMENTS.size) == (216, 56)


@pytest.mark.parametrize(
    ("sent", "expected"),
    [((0, 0, 1), (0, 0, -1)), ((0.6, 0, 0.8), (0.6, 0, -0.8)), ((0, 0.6, 0.8), (0, 0.6, -0.8))],
)
def test_forward_is_plus_z_there_and_minus_z_here(sent, expected):
    row = row_of(datum(ray=sent))
    for name in ("direction_head", "left_direction_head", "right_direction_head"):
        np.testing.assert_allclose(row[name], expected, atol=1e-6)
    np.testing.assert_allclose(row["origin_m"], (0, 0.01, -0.02), atol=1e-6)
    assert (row["left_pupil_mm"], row["right_pupil_mm"]) == (3.5, 4.0)
    sample = codec.decode_datum(datum(ray=sent))
    assert (sample.t_device_ns, sample.counter) == (1234, 7)
    assert sample.openness_01 == pytest.approx((0.9, 0.8))


@pytest.mark.parametrize(
    ("state", "has_gaze", "valid"), [(0, False, False), (1, True, False), (2, True, True)]
)
def test_an_eye_is_missing_unreliable_or_compensated_as_the_header_says(state, has_gaze, valid):
    row = row_of(datum(states=(state, 3)))
    assert np.isfinite(row["left_direction_head"]).all() == has_gaze
    assert (bool(row["left_valid"]), bool(row["right_valid"])) == (valid, True)
    assert math.isnan(row["left_pupil_mm"]) == (not has_gaze)


@pytest.mark.parametrize("status", [0, 1])
def test_a_tracker_that_adjusts_itself_or_sees_nobody_gives_no_gaze(status):
    row = row_of(datum(status=status))
    assert not row["valid"]
    assert not row["left_valid"]
    assert np.isnan(row["direction_head"]).all()
    assert math.isnan(row["left_pupil_mm"])


def test_gaze_and_measurements_of_two_frames_are_no_datum():
    assert codec.decode_datum(datum(measured_frame=8)) is None


@given(st.binary(min_size=272, max_size=272))
@settings(max_examples=200, deadline=None)
def test_damaged_data_never_raise_and_make_no_direction_that_is_no_unit_vector(noise):
    noise = noise[:192] + datum()[192:200] + noise[200:216] + datum()[216:232] + noise[232:]
    found = codec.decode_datum(noise)
    if found is not None:
        row = rows_to_values([found.row])[0]
        length = np.linalg.norm(row["left_direction_head"].astype(float))
        assert not row["left_valid"] or abs(length - 1) < 1e-4


def test_data_come_out_of_the_library_as_they_were_put_in(stand_in):
    stand_in.set(calibrated=True, quality=2)
    library = VarjoLibrary(str(built_library()), SystemClock())
    library.open(1.0)
    assert stand_in.asked == ("None", "OutputFrequencyMaximumSupported")
    stand_in.push(datum())
    (message,) = library.receive(5.0)
    assert message.frames == (datum(),)
    assert library.request((b"start",), 1.0).frames[1] == b"4.7.0.11"
    assert library.request((b"time",), 1.0).frames[1] == struct.pack("<q", 123456789)
    state = codec.decode_state(library.request((b"state",), 1.0).frames[1])
    assert state == codec.TrackerState(True, True, False, True, 2, 2)
    assert state.quality_text == "medium quality"
    library.request((b"calibrate",), 1.0)
    assert codec.decode_state(library.request((b"state",), 1.0).frames[1]).is_calibrating
    library.close()
    assert stand_in.session_count == 0


@pytest.mark.parametrize(
    ("system", "says"),
    [
        ({"available": False}, "system is not available; start Varjo Base"),
        ({"allowed": False}, "eye tracking is not allowed"),
        ({"init_error": 103}, r"does not start: Gaze not allowed \(error 103\)"),
    ],
)
def test_a_system_that_gives_no_gaze_is_told_with_the_cure(stand_in, system, says):
    stand_in.set(**system)
    with pytest.raises(DeviceNotFound, match=says):
        VarjoLibrary(str(built_library()), SystemClock()).open(1.0)
    assert stand_in.session_count == 0


def test_a_headset_of_one_rate_is_asked_for_none(stand_in):
    stand_in.set(init_error=105)
    library = VarjoLibrary(str(built_library()), SystemClock())
    library.open(1.0)
    library.close()


def test_a_library_that_is_not_there_or_another_is_told():
    with pytest.raises(DeviceNotFound, match=r"nowhere.*cannot be loaded.*library_path"):
        VarjoLibrary("/nowhere/VarjoLib.dll", SystemClock()).open(1.0)


def test_a_calibration_ends_with_the_systems_quality():
    rig = GazeRig(Varjo, VarjoSimulator, quality=2).start().run(0.5)
    assert "not calibrated" in rig.messages()

    rig.driver.begin_calibration()
    outcome = rig.driver.end_calibration(5.0)

    assert outcome.succeeded
    assert outcome.message == "medium quality"
    rig.run(0.5)
    assert "not calibrated" not in rig.messages()


def test_an_unplugged_headset_blocks():
    rig = GazeRig(Varjo, VarjoSimulator).start().run(0.3)
    rig.simulator.is_connected = False
    rig.run(0.5)
    assert "the headset is not connected" in rig.messages()


def test_the_clock_is_asked_for_and_every_frame_comes_once():
    rig = GazeRig(Varjo, VarjoSimulator, error=PERFECT).start().run(2.5)
    seq = np.concatenate([b.seq for b in rig.batches if b.schema.name == "gaze"])
    assert (np.diff(seq) == 1).all()
    assert len(seq) > 450
    assert len(rig.driver.clock_pairs()) >= 3

"""Vive Pro Eye through SRanipal: the layout a C compiler gives the header's structures."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.sranipal_library import StandIn, built_library
from tests.faults.sessions import lab, perform
from visavis.devices.drivers.sranipal import codec
from visavis.devices.drivers.sranipal.driver import ViveProEye
from visavis.devices.drivers.sranipal.library import SranipalLibrary
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.registry import driver_spec
from visavis.devices.sim.native_build import find_compiler
from visavis.devices.sim.sranipal import SranipalSimulator
from visavis.lab.clock import SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import DeviceDisconnected, DeviceNotFound


@pytest.fixture(scope="module")
def stand_in():
    if find_compiler() is None:
        pytest.skip("the stand-in needs a C compiler: apt-get install gcc")
    return StandIn(built_library())


def frame(number=7, stamp_ms=1234, *, valid=0x1F, ray=(0.0, 0.0, 1.0), pupil=3.5, openness=0.9):
    eye = struct.pack("<Q3f3fff2f", valid, 32.0, 1.0, -2.0, *ray, pupil, openness, 0.5, 0.5)
    head = struct.pack("<?3xii4x", False, number, stamp_ms)
    return head + 3 * eye + bytes(8 + 48 + 24)


def test_the_codec_reads_where_the_compiler_puts_the_headers_members(stand_in):
    assert stand_in.size == codec.EYE_DATA.size == len(frame())
    left, eye = 16, 48
    expected = [4, 8, left, left + eye + 32, left + 2 * eye, left + 3 * eye + 4,
                left + 3 * eye + 8 + 4, 216]  # fmt: skip
    assert stand_in.offsets() == expected


def test_a_frame_comes_out_of_the_library_as_it_was_put_in(stand_in):
    stand_in.answer_with(0, 0, True)
    stand_in.hold(frame())
    library = SranipalLibrary(str(built_library()), SystemClock())
    library.open(1.0)
    assert library.receive(5.0)[0].frames == (frame(),)
    assert library.request((b"start",), 1.0).frames == (b"start", b"\x01")
    stand_in.hold(frame(8))
    assert [m.frames for m in library.receive(5.0)] == [(frame(8),)]
    stand_in.answer_with(0, 5, True)
    with pytest.raises(DeviceDisconnected, match=r"no eye data \(error 5\)"):
        receive_all(library)
    library.close()
    stand_in.answer_with(0, 0, True)


def receive_all(library):
    while True:
        library.receive(5.0)


def test_a_runtime_that_does_not_start_and_another_headset_are_told(stand_in):
    library = SranipalLibrary(str(built_library()), SystemClock())
    stand_in.answer_with(-3, 0, True)
    with pytest.raises(DeviceNotFound, match=r"eye module \(error -3\); start SR_Runtime"):
        library.open(1.0)
    stand_in.answer_with(0, -1, False)
    with pytest.raises(DeviceNotFound, match="not a Vive Pro Eye and gives no eye data"):
        ViveProEye("eye_tracker", library, SystemClock()).open(0.2)
    stand_in.answer_with(0, 0, True)
    with pytest.raises(DeviceNotFound, match=r"nowhere.*cannot be loaded.*library_path"):
        SranipalLibrary("/nowhere/SRanipal.dll", SystemClock()).open(1.0)


def test_another_headset_whose_eye_data_come_is_taken_and_told():
    rig = GazeRig(ViveProEye, SranipalSimulator)
    rig.simulator.is_pro_eye = False
    rig.start().run(0.2)

    assert rig.driver.health().received > 20
    assert rig.driver.info.model == "eye tracker of SRanipal"
    assert "does not call this headset a Vive Pro Eye" in rig.messages()


@pytest.mark.parametrize(
    ("sent", "expected"),
    [((0, 0, 1), (0, 0, -1)), ((0.6, 0, 0.8), (-0.6, 0, -0.8)), ((0, 0.6, 0.8), (0, 0.6, -0.8))],
)
def test_axes_are_turned_to_ours_as_public_clients_turn_them(sent, expected):
    found = codec.decode_eye_data(frame(ray=sent))
    row = rows_to_values([found.sample.row])[0]
    for name in ("direction_head", "left_direction_head", "right_direction_head"):
        np.testing.assert_allclose(row[name], expected, atol=1e-6)
    assert found.sample.t_device_ns == 1_234_000_000
    assert (row["left_pupil_mm"], found.sample.openness_01) == (3.5, pytest.approx((0.9, 0.9)))


def test_what_is_not_valid_is_missing_never_zero():
    row = rows_to_values([codec.decode_eye_data(frame(valid=0)).sample.row])[0]
    assert not row["valid"]
    assert np.isnan(row["left_direction_head"]).all()
    assert math.isnan(row["left_pupil_mm"])
    assert all(map(math.isnan, codec.decode_eye_data(frame(valid=0)).sample.openness_01))


@given(st.binary(min_size=240, max_size=240))
@settings(max_examples=300, deadline=None)
def test_damaged_frames_never_raise_and_make_no_direction_that_is_no_unit_vector(noise):
    found = codec.decode_eye_data(noise)
    if found is not None:
        row = rows_to_values([found.sample.row])[0]
        length = np.linalg.norm(row["left_direction_head"].astype(float))
        assert not row["left_valid"] or abs(length - 1) < 1e-4


def test_every_frame_comes_once_with_its_number_and_openness():
    rig = GazeRig(ViveProEye, SranipalSimulator, rate_hz=120.0, error=PERFECT).start().run(2.0)
    gaze = [b for b in rig.batches if b.schema.name == "gaze"]
    opened = [b for b in rig.batches if b.schema.name == "openness"]
    seq = np.concatenate([b.seq for b in gaze])
    assert len(seq) > 230
    assert (np.diff(seq) == 1).all()
    assert seq.tolist() == np.concatenate([b.seq for b in opened]).tolist()
    open_01 = np.concatenate([b.values["left_openness_01"] for b in opened])
    assert np.nanmin(open_01) >= 0
    assert np.nanmax(open_01) > 0.5


def test_a_session_records_gaze_and_openness_side_by_side(tmp_path):
    config = lab(tmp_path)
    tracker = DeviceConfig(
        role="eye_tracker",
        driver="vive_pro_eye",
        simulated=True,
        options=driver_spec("vive_pro_eye").options(rate_hz=60.0).model_dump(),
    )
    recording = perform(
        config.model_copy(update={"devices": {**config.devices, "eye_tracker": tracker}})
    )
    gaze, opened = recording.stream_arrays("gaze"), recording.stream_arrays("openness")
    assert gaze["seq"].tolist() == opened["seq"].tolist()
    assert {"complete"} == set(recording.trials()["status"])
    blinks = opened["left_openness_01"] < 0.5
    assert 0 < blinks.mean() < 0.2
    assert not gaze["left_valid"][blinks].any()

"""Neon: payloads by length, the camera, and the genuine client against servers of our own."""

import logging
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.neon_host import NeonHost
from visavis.devices.contracts import DeviceState, SessionName
from visavis.devices.drivers.neon import codec
from visavis.devices.drivers.neon.driver import Neon
from visavis.devices.drivers.neon.network import NeonNetwork
from visavis.devices.drivers.neon.spec import REMEDY
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.neon import PAYLOAD_SIZES, NeonSimulator
from visavis.lab.clock import NS_PER_MS, SystemClock
from visavis.lab.clock_fit import offset_ns
from visavis.lab.errors import DeviceError, DeviceNotFound, DeviceTimeout
from visavis.lab.geometry import angle_deg

CAMERA = codec.SceneCamera(1000.0, 1000.0, 800.0, 600.0)
RIGHT_UP = (1800.0, -400.0)  # 45° to the right and as far up, for this camera


def row_of(payload, camera=CAMERA):
    sample = codec.decode_gaze(5, 7, payload, camera)
    return rows_to_values([sample.row])[0]


def test_nine_bytes_are_a_pixel_and_worn():
    row = row_of(bytes.fromhex("44484000 44160000 ff"))  # 801, 600, 255

    np.testing.assert_allclose(row["direction_head"], (0.001, 0, -1), atol=1e-6)
    assert row["valid"]
    assert np.isnan(row["left_direction_head"]).all()
    assert np.isnan(row["left_pupil_mm"])


def test_pixel_axes_become_right_up_and_forward():
    row = row_of(struct.pack("!ffB", *RIGHT_UP, 255))

    np.testing.assert_allclose(row["direction_head"], np.array([1, 1, -1]) / 3**0.5, atol=1e-6)


def test_camera_that_looks_up_raises_the_ray():
    up = codec.SceneCamera(pitch_deg=10.0).ray(800.0, 600.0)

    np.testing.assert_allclose(up, (0, np.sin(np.radians(10)), -np.cos(np.radians(10))), atol=1e-9)


def test_not_worn_is_invalid_but_keeps_the_value():
    row = row_of(struct.pack("!ffB", 800, 600, 0))

    assert not row["valid"]
    assert np.isfinite(row["direction_head"]).all()


def test_dual_payload_puts_left_first():
    row = row_of(struct.pack("!ffBff", 700, 600, 255, 900, 600))

    assert row["left_direction_head"][0] < 0 < row["right_direction_head"][0]
    assert (row["eyes_used"], row["left_valid"], row["right_valid"]) == (3, True, True)


def test_eye_state_gives_diameters_and_lids_tell_a_closed_eye():
    eye = (3.25, -32.0, 1.0, -20.0, 0.0, 0.0, 1.0)
    other = (4.5, 32.0, 1.0, -20.0, 0.0, 0.0, 1.0)
    lids = (0.3, -0.3, 9.0, 0.1, -0.1, 0.2)
    row = row_of(struct.pack("!ffB24f", 800, 600, 255, *eye, *other, *lids, 790, 600, 810, 600))

    assert (row["left_pupil_mm"], row["right_pupil_mm"]) == (3.25, 4.5)
    assert (row["left_valid"], row["right_valid"]) == (True, False)
    assert row["eyes_used"] == 1
    assert np.isfinite(row["right_direction_head"]).all()


READERS = {
    9: "GazeData",
    17: "DualMonocularGazeData",
    25: "BinoAndDualMonoGazeData",
    65: "EyestateGazeData",
    89: "EyestateEyelidGazeData",
    105: "EyestateEyelidDualMonoGazeData",
}
NEAR = codec.SceneCamera(1.0, 1.0, 1.0, 1.0)
"""A camera for which the numbers below are places all over its picture."""


def read_by_the_vendor(payload):
    """Return what the vendor's client reads: point and each eye's, worn, pupils, apertures."""
    gaze = pytest.importorskip("pupil_labs.realtime_api.streaming.gaze")
    from pupil_labs.realtime_api.streaming.base import RTSPData

    read = getattr(gaze, READERS[len(payload)]).from_raw(RTSPData(payload, 0.0))
    if len(payload) == 17:
        return (None, tuple(read.left), tuple(read.right)), read.worn, (), ()
    points = [(read.x, read.y), None, None]
    if hasattr(read, "mono_left_x"):
        points[1] = read.mono_left_x, read.mono_left_y
        points[2] = read.mono_right_x, read.mono_right_y
    pupils = lids = ()
    if hasattr(read, "pupil_diameter_left"):
        pupils = read.pupil_diameter_left, read.pupil_diameter_right
    if hasattr(read, "eyelid_aperture_left"):
        lids = read.eyelid_aperture_left, read.eyelid_aperture_right
    return tuple(points), read.worn, pupils, lids


@pytest.mark.parametrize("size", PAYLOAD_SIZES)
@given(
    # Pupils that can be, apertures on both sides of what counts as closed.
    numbers=st.lists(st.floats(0.625, 1.625, width=32), min_size=26, max_size=26),
    worn=st.integers(0, 255) | st.just(255),
)
def test_payloads_are_read_as_the_vendors_client_reads_them(size, numbers, worn):
    floats = numbers[: (size - 9) // 4]
    payload = struct.pack(f"!ffB{len(floats)}f", *numbers[-2:], worn, *floats)
    (both, left, right), is_worn, pupils, apertures = read_by_the_vendor(payload)
    is_open = [is_worn and aperture >= codec.CLOSED_BELOW_MM for aperture in apertures]

    row = row_of(payload, NEAR)
    for point, name in (
        (both, "direction_head"),
        (left, "left_direction_head"),
        (right, "right_direction_head"),
    ):
        if point is not None:
            ray = np.array([point[0] - 1.0, 1.0 - point[1], -1.0])
            np.testing.assert_allclose(row[name], ray / np.linalg.norm(ray), atol=2e-7)
        elif name != "direction_head":  # else it is the mean of both eyes
            assert np.isnan(row[name]).all()
    found = (row["left_pupil_mm"], row["right_pupil_mm"])
    np.testing.assert_array_equal(found, pupils or (np.nan, np.nan))
    has_eyes = left is not None
    expected = is_open if apertures else [is_worn, is_worn]
    assert [row["left_valid"], row["right_valid"]] == [has_eyes and seen for seen in expected]
    assert row["valid"] == any(expected)
    if apertures:
        assert row["eyes_used"] == is_open[0] | is_open[1] << 1


@pytest.mark.parametrize("size", PAYLOAD_SIZES)
def test_every_length_gives_the_body_direction(size):
    rig = GazeRig(Neon, NeonSimulator, error=PERFECT, payload_size=size).start().run(0.5)

    errors_deg = angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction)
    assert errors_deg.max() < 0.02
    assert rig.column("valid").all()


def test_unknown_length_is_counted_and_told():
    rig = GazeRig(Neon, NeonSimulator, {"kind": "version", "start_s": 1.0, "text": "16"})
    rig.start().run(3.0)

    assert "gaze payloads of unknown length 121" in rig.messages()
    assert "could not be read" in rig.messages()


def test_lens_distortion_of_the_module_is_undone():
    bent = (0.1, -0.2, 0.001, -0.0005, 0.05, 0.2, -0.1, 0.02)
    rig = GazeRig(Neon, NeonSimulator, error=PERFECT, distortion=bent, body=FixatingBody(20, 12))
    rig.start().run(0.5)

    errors_deg = angle_deg(rig.column("direction_head").astype("f8"), rig.body.direction)
    assert errors_deg.max() < 0.05
    assert rig.driver.info.serial == "123456"


@given(st.integers(0, 200).flatmap(lambda n: st.binary(min_size=n, max_size=n)))
def test_any_payload_gives_unit_vectors_or_nothing(payload):
    sample = codec.decode_gaze(0, 0, payload, CAMERA)
    assert (sample is None) == (len(payload) not in PAYLOAD_SIZES)
    if sample is not None:
        row = rows_to_values([sample.row])[0]
        for name in ("direction_head", "left_direction_head", "right_direction_head"):
            length = np.linalg.norm(row[name].astype("f8"))
            assert np.isnan(length) or abs(length - 1) < 1e-4


@given(st.binary(max_size=300))
def test_any_calibration_file_is_read_or_refused(raw):
    codec.decode_calibration(raw, 0.0)


def test_packet_numbers_go_on_past_65535():
    assert codec.unwrapped(2, 65_534) == 65_538
    assert codec.unwrapped(65_535, 65_536) == 65_535


def test_low_battery_is_told_and_reported():
    rig = GazeRig(Neon, NeonSimulator, battery_level=12).start().run(0.2)

    assert rig.driver.health().battery_01 == 0.12
    assert "the phone's battery is low" in rig.messages()


def test_phone_without_glasses_is_not_opened():
    rig = GazeRig(Neon, NeonSimulator)
    rig.simulator.has_glasses = False

    with pytest.raises(DeviceNotFound, match="no gaze sensor; connect the glasses"):
        rig.driver.open(2.0)


def test_calibration_is_refused_by_name():
    rig = GazeRig(Neon, NeonSimulator).start()

    with pytest.raises(Exception, match="a neon tracker cannot be calibrated from here"):
        rig.driver.begin_calibration()


def test_event_bears_the_phones_time():
    rig = GazeRig(Neon, NeonSimulator).start().run(2.0)
    t_ns = rig.clock.now_ns()

    rig.driver.annotate("trial 1", t_ns)

    ((name, stamp_ns),) = rig.simulator.events
    assert name == "trial 1"
    assert abs(stamp_ns - rig.simulator.source.device_ns(t_ns)) < NS_PER_MS


NAME = SessionName("stare", "S001", 1, 2)
NOT_RECORDED = "the phone does not record: markers and its video will be lost"


def test_phone_that_does_not_record_is_told_before_the_session():
    rig = GazeRig(Neon, NeonSimulator).start()
    assert NOT_RECORDED in rig.messages()

    recording = GazeRig(Neon, NeonSimulator)
    recording.simulator.recording_id = "of the operator"
    recording.start()
    assert NOT_RECORDED not in recording.messages()


def test_marker_that_reached_no_recording_is_counted():
    rig = GazeRig(Neon, NeonSimulator).start()
    rig.driver.annotate("trial 1", rig.clock.now_ns())
    rig.run(0.2)

    assert "1 markers reached no recording of the phone" in rig.messages()


def test_recording_is_begun_named_and_saved_where_it_is_wanted(tmp_path):
    rig = GazeRig(Neon, NeonSimulator, options={"starts_recording": True})
    rig.driver.open(2.0)
    rig.driver.begin_recording(NAME, tmp_path)
    rig.driver.start(lambda batch: None)
    rig.driver.poll(0.01)
    assert NOT_RECORDED not in rig.messages()
    rig.driver.close()

    assert rig.simulator.recordings == ["recording-0"]
    assert [text for text, _ in rig.simulator.events] == ["stare_S001_001_02"]


@pytest.mark.parametrize("wanted", [True, False])
def test_recording_of_the_operator_is_left_alone(tmp_path, wanted):
    rig = GazeRig(Neon, NeonSimulator, options={"starts_recording": wanted})
    rig.simulator.recording_id = "of the operator"
    rig.driver.open(2.0)
    rig.driver.begin_recording(NAME, tmp_path)
    rig.driver.close()

    assert rig.simulator.recording_id == "of the operator"


def test_reason_for_which_the_app_does_not_record_is_told(tmp_path):
    rig = GazeRig(Neon, NeonSimulator, options={"starts_recording": True})
    rig.simulator.refusal = "No wearer selected"
    rig.driver.open(2.0)

    with pytest.raises(DeviceError, match=r"does not record: No wearer selected; .*workspace"):
        rig.driver.begin_recording(NAME, tmp_path)


class Lab:
    def __init__(self, *faults, **options):
        self.clock = SystemClock()
        self.simulator = NeonSimulator(
            FixatingBody(5.0, 3.0),
            clock=self.clock,
            seed=1,
            error=PERFECT,
            faults=FaultSchedule.from_config(faults),
        )
        self.host = NeonHost(self.simulator, self.clock)
        self.options = options

    def driver(self, **options):
        wire = NeonNetwork(
            "127.0.0.1", self.host.port, self.clock, remedy=REMEDY, is_simulated=True
        )
        return Neon("eyes", wire, self.clock, **{"lost_after_s": 0.6, **self.options, **options})


@pytest.fixture(autouse=True)
def quiet_client():
    yield
    logging.getLogger("asyncio").setLevel(logging.WARNING)


def test_genuine_client_delivers_gaze_clock_events_and_status():
    lab = Lab(exchange_interval_s=0.05)
    with lab.host:
        driver = lab.driver()
        driver.open(10.0)
        opening = len(driver.clock_pairs())
        with gaze_rigs.pumped(driver, lab.clock) as (pump, batches):
            gaze_rigs.step_until(lab.clock, pump, lambda: sum(map(len, batches)) > 60)
            values = np.concatenate([b.values for b in batches])
            errors_deg = angle_deg(
                values["direction_head"].astype("f8"), FixatingBody(5.0, 3.0).direction
            )
            assert errors_deg.max() < 0.02
            gaze_rigs.step_until(lab.clock, pump, lambda: len(driver.clock_pairs()) > opening + 3)
            driver.annotate("mark", lab.clock.now_ns())
            lab.simulator.battery_level = 11
            lab.host.tell()
            gaze_rigs.step_until(lab.clock, pump, lambda: driver.health().battery_01 == 0.11)
    assert lab.simulator.events[0][0] == "mark"
    true_ns = -lab.simulator.source.device_ns(0)
    assert abs(offset_ns(driver.clock_pairs()) - true_ns) < 5 * NS_PER_MS


def test_genuine_client_begins_and_saves_a_recording(quiet_client, tmp_path):
    lab = Lab()
    with lab.host:
        driver = lab.driver(starts_recording=True)
        driver.open(5.0)
        driver.begin_recording(NAME, tmp_path)
        assert lab.simulator.recording_id == "recording-0"
        driver.close()
        driver = lab.driver(starts_recording=True)
        driver.open(5.0)
        lab.simulator.refusal = "Low storage"
        with pytest.raises(DeviceError, match="does not record: Low storage"):
            driver.begin_recording(NAME, tmp_path)
        driver.close()

    assert lab.simulator.recordings == ["recording-0"]


def test_genuine_client_keeps_the_contract():
    lab = Lab(opening_exchanges=2)
    made = []
    with lab.host:

        def make():
            made.append(lab.driver())
            return made[-1]

        wait = gaze_rigs.let_pass_on(lab.clock)
        gaze_rigs.conformance.check_batches(make, wait)
        gaze_rigs.conformance.check_eye_tracker(make, wait)
        gaze_rigs.conformance.check_lifecycle(make, wait)
        for device in made:
            device.close()


def test_phone_that_goes_away_comes_back_within_two_seconds():
    lab = Lab(opening_exchanges=2)
    with lab.host:
        driver = lab.driver()
        driver.open(10.0)
        with gaze_rigs.pumped(driver, lab.clock) as (pump, batches):
            gaze_rigs.step_until(lab.clock, pump, lambda: bool(batches))
            back_ns = gaze_rigs.lose_for(lab.simulator, lab.clock, 0.8)
            gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.FAULT)
            gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.STREAMING)
            pump.step()
            events = pump.take_events()
    assert events[-1].kind == "reconnected"
    assert events[-1].t_ns - back_ns < 2 * 10**9


def test_phone_that_never_answers_times_out():
    lab = Lab({"kind": "mute"})
    with lab.host, pytest.raises(DeviceTimeout, match="start the Neon Companion app"):
        lab.driver().open(0.5)


def test_nobody_there_says_what_to_start():
    clock = SystemClock()
    wire = NeonNetwork("127.0.0.1", 1, clock, remedy=REMEDY)

    with pytest.raises(DeviceNotFound, match="put phone and computer into one network"):
        Neon("eyes", wire, clock).open(2.0)

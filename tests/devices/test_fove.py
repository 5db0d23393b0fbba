"""FOVE: golden frames, and the real ctypes path against a library compiled here."""

import ctypes
import math
import shutil

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.fove_library import FoveStub, build_stub
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.fove import codec
from visavis.devices.drivers.fove import library as fove_library
from visavis.devices.drivers.fove.driver import Fove
from visavis.devices.drivers.fove.library import FoveLibrary
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.sim.fove import FoveSimulator
from visavis.devices.sim.gaze.source import GazeSource
from visavis.devices.transports import MemoryTransport
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.errors import DeviceNotFound, ProtocolViolation

S = math.sqrt(0.5)


def frame(**changes):
    """One frame: left eye at (0, 0, 1), right eye 45° to the right, radii 1.5 and 2 mm."""
    fields = {
        "id": 7, "us": 1_000_001,
        "l_code": 0, "l": (0.0, 0.0, 1.0), "ls_code": 0, "ls": 1, "lr_code": 0, "lr": 0.0015,
        "r_code": 0, "r": (S, 0.0, S), "rs_code": 0, "rs": 1, "rr_code": 0, "rr": 0.002,
        "c_code": 0, "o": (0.0, 0.01, 0.02), "d": (0.0, 0.6, 0.8),
    }  # fmt: skip
    fields.update(changes)
    flat = []
    for value in fields.values():
        flat.extend(value if isinstance(value, tuple) else (value,))
    return codec.EYE_FRAME.pack(*flat)


def decoded(**changes):
    sample, codes = codec.decode_eye_frame(frame(**changes), 0.064)
    return sample, rows_to_values([sample.row])[0], codes


def test_size_of_an_eye_frame_is_that_of_the_claims():
    assert codec.EYE_FRAME.size == 16 + 2 * (16 + 8 + 8) + 28


def test_plus_z_is_forward_and_is_turned_to_minus_z():
    sample, row, codes = decoded()

    assert (sample.t_device_ns, sample.counter, codes) == (1_000_001_000, 7, frozenset())
    np.testing.assert_allclose(row["left_direction_head"], (0, 0, -1), atol=1e-6)
    np.testing.assert_allclose(row["right_direction_head"], (S, 0, -S), atol=1e-6)
    np.testing.assert_allclose(row["direction_head"], (0, 0.6, -0.8), atol=1e-6)
    np.testing.assert_allclose(row["origin_m"], (0, 0.01, -0.02), atol=1e-6)


def test_radius_in_metres_becomes_diameter_in_millimetres():
    _, row, _ = decoded()

    assert row["left_pupil_mm"] == pytest.approx(3.0)
    assert row["right_pupil_mm"] == pytest.approx(4.0)


def test_unreliable_keeps_the_value_but_not_validity():
    _, row, codes = decoded(l_code=1006, r_code=1006, c_code=1006)

    assert not row["valid"]
    assert np.isfinite(row["direction_head"]).all()
    assert 1006 in codes


def test_low_accuracy_stays_valid_and_is_told():
    _, row, codes = decoded(c_code=1007)

    assert row["valid"]
    assert codes == {1007}


def test_no_update_is_missing_never_zero():
    _, row, _ = decoded(l_code=1003, r_code=1003, c_code=1003, lr_code=1003, rr_code=1003)

    assert not row["valid"]
    for name in ("direction_head", "left_direction_head", "right_direction_head", "left_pupil_mm"):
        assert np.isnan(row[name]).all()


@pytest.mark.parametrize(("state", "seen"), [(0, False), (2, True)])
def test_eye_not_detected_is_missing_and_closed_eye_invalid(state, seen):
    _, row, _ = decoded(ls=state)

    assert not row["left_valid"]
    assert np.isfinite(row["left_direction_head"]).all() == seen
    assert row["eyes_used"] == 2


@given(st.binary(max_size=200) | st.binary(min_size=108, max_size=108))
def test_any_bytes_give_unit_vectors_or_nothing(payload):
    found = codec.decode_eye_frame(payload, 0.064)
    if found is not None:
        row = rows_to_values([found[0].row])[0]
        for name in ("direction_head", "left_direction_head", "right_direction_head"):
            length = np.linalg.norm(row[name].astype("f8"))
            assert np.isnan(length) or abs(length - 1) < 1e-4


@pytest.mark.parametrize(("quality", "text"), [(5, "high"), (6, "medium"), (7, "low")])
def test_calibration_keeps_its_final_quality(quality, text):
    rig = GazeRig(Fove, FoveSimulator, quality=quality).start().run(0.2)
    assert "not calibrated" in rig.messages()

    rig.driver.begin_calibration()
    outcome = rig.driver.end_calibration(5.0)

    assert outcome.succeeded
    assert text in outcome.message
    assert rig.driver.calibration == outcome
    assert "not calibrated" not in rig.messages()


def test_calibration_with_closed_eyes_fails():
    rig = GazeRig(Fove, FoveSimulator).start().run(0.2)
    rig.body.openness_01 = 0.0
    rig.driver.begin_calibration()

    assert not rig.driver.end_calibration(5.0).succeeded


def test_version_mismatch_names_both_versions():
    rig = GazeRig(Fove, FoveSimulator, {"kind": "version", "text": "2.0.0"})

    with pytest.raises(ProtocolViolation, match=r"client 1\.4\.0, runtime 2\.0\.0"):
        rig.driver.open(2.0)


def test_low_accuracy_throughout_is_a_fault_of_the_operator_screen():
    rig = GazeRig(Fove, FoveSimulator, vector_code=1007).start().run(1.0)

    assert "low accuracy (code 1007)" in rig.messages()


def test_missing_library_says_what_to_install():
    clock = SystemClock()
    driver = Fove("eyes", FoveLibrary("/nowhere/FoveClient.dll", clock), clock)

    with pytest.raises(DeviceNotFound, match="install the FOVE runtime"):
        driver.open(1.0)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler: install gcc to compile the FoveClient stub")
    return build_stub(tmp_path_factory.mktemp("fove"))


class Lab:
    def __init__(self, library):
        self.clock = SystemClock()
        simulator = FoveSimulator(FixatingBody(5.0, 3.0), clock=self.clock, seed=1, error=PERFECT)
        self.stub = FoveStub(library, simulator, self.clock)
        self.wire = FoveLibrary(str(library), self.clock, is_simulated=True)
        self.driver = Fove("eyes", self.wire, self.clock, lost_after_s=1.0)


def test_real_library_path_keeps_the_contract(library):
    lab = Lab(library)
    made = []

    def make():
        made.append(Fove("eyes", FoveLibrary(str(library), lab.clock), lab.clock))
        return made[-1]

    with lab.stub:
        gaze_rigs.keeps_the_contract(make, gaze_rigs.let_pass_on(lab.clock))
        for device in made:
            device.close()


def test_library_delivers_reconnects_and_calibrates(library):
    lab = Lab(library)
    with lab.stub:
        lab.driver.open(5.0)
        with gaze_rigs.pumped(lab.driver, lab.clock) as (pump, batches):
            gaze_rigs.step_until(lab.clock, pump, lambda: sum(map(len, batches)) > 20)
            direction = batches[-1].values["direction_head"][-1]
            np.testing.assert_allclose(direction, FixatingBody(5.0, 3.0).direction, atol=1e-4)
            lab.driver.begin_calibration()
            assert lab.driver.end_calibration(10.0).message == "succeeded, high quality"
            lab.stub.set_connected(False)
            gaze_rigs.step_until(lab.clock, pump, lambda: lab.driver.state is DeviceState.FAULT)
            lab.stub.set_connected(True)
            back_ns = lab.clock.now_ns()
            gaze_rigs.step_until(lab.clock, pump, lambda: lab.driver.state is DeviceState.STREAMING)
            events = pump.take_events()
    assert events[-1].kind == "reconnected"
    assert events[-1].t_ns - back_ns < 2 * 10**9


@pytest.mark.parametrize(
    ("function", "code", "error", "text"),
    [
        ("checkSoftwareVersions", 4, ProtocolViolation, "runtime is too old for this FoveClient"),
        ("checkSoftwareVersions", 6, ProtocolViolation, "library is too old for the FOVE runtime"),
        ("createHeadset", 7, DeviceNotFound, "service does not answer"),
        ("isHardwareConnected", 7, DeviceNotFound, "start the FOVE runtime"),
    ],
)
def test_error_codes_of_the_library_are_named(library, function, code, error, text):
    lab = Lab(library)
    with lab.stub:
        lab.stub.fail(function, code)
        with pytest.raises(error, match=text):
            lab.driver.open(1.0)


def test_library_without_the_functions_is_refused():
    clock = SystemClock()
    path = ctypes.util.find_library("m") if hasattr(ctypes, "util") else "libm.so.6"

    with pytest.raises(DeviceNotFound, match="not a FoveClient library"):
        Fove("eyes", FoveLibrary(path or "libm.so.6", clock), clock).open(1.0)


def test_simulator_counts_from_zero_and_leaves_holes_where_it_loses():
    clock = SimClock()
    source = GazeSource(FixatingBody(), seed=1, clock=clock, rate_hz=120)
    assert [shot.number for shot in source.take(10**9)][:3] == [0, 1, 2]
    wire = MemoryTransport(FoveSimulator(FixatingBody(), clock=clock, seed=1), clock)
    assert wire.is_simulated


# ---- FoveAPI.h: the vendor's own header ---------------------------------------------------------

HEADER_CODES = {  # Fove_ErrorCode, by the header's names
    "Connect_NotConnected": 7,
    "Connect_RuntimeVersionTooOld": 4,
    "Connect_ClientVersionTooOld": 6,
    "API_NotRegistered": 104,
    "API_Timeout": 130,
    "Data_NoUpdate": 1003,
    "Data_Uncalibrated": 1004,
    "Data_Unreliable": 1006,
    "Data_LowAccuracy": 1007,
    "Hardware_Disconnected": 2006,
    "License_FeatureAccessDenied": 12000,
}
HEADER_CAPABILITIES = {"EyeTracking": 1 << 3, "UserPresence": 1 << 5, "PupilRadius": 1 << 14}
HEADER_STATES = (  # Fove_CalibrationState, in order from 0
    "NotStarted",
    "HeadsetAdjustment",
    "WaitingForUser",
    "CollectingData",
    "ProcessingData",
    "Successful_HighQuality",
    "Successful_MediumQuality",
    "Successful_LowQuality",
    "Failed_Unknown",
)


def test_codes_states_and_capabilities_are_those_of_the_vendors_header():
    ours = {
        "Connect_NotConnected": codec.NOT_CONNECTED,
        "Connect_RuntimeVersionTooOld": codec.RUNTIME_TOO_OLD,
        "Connect_ClientVersionTooOld": codec.CLIENT_TOO_OLD,
        "API_NotRegistered": codec.NOT_REGISTERED,
        "API_Timeout": codec.TIMED_OUT,
        "Data_NoUpdate": codec.NO_UPDATE,
        "Data_Uncalibrated": codec.UNCALIBRATED,
        "Data_Unreliable": codec.UNRELIABLE,
        "Data_LowAccuracy": codec.LOW_ACCURACY,
        "Hardware_Disconnected": codec.HARDWARE_GONE,
        "License_FeatureAccessDenied": 12000,
    }
    assert ours == HEADER_CODES
    assert set(codec.ERROR_TEXTS) == set(HEADER_CODES.values())
    assert fove_library.CAPABILITIES == sum(HEADER_CAPABILITIES.values())
    assert (
        len(codec.CALIBRATION_STATES) == codec.FIRST_FAILED == HEADER_STATES.index("Failed_Unknown")
    )
    successes = {i for i, name in enumerate(HEADER_STATES) if name.startswith("Successful")}
    assert codec.SUCCESS_STATES == successes


def test_versions_have_the_headers_layout_and_room_for_more():
    versions = fove_library._Versions
    # 7 ints, 64 characters, 6 ints, 64 characters, 3 ints, a bool: 193 bytes
    assert versions.client_hash.offset == 28
    assert versions.runtime_major.offset == 28 + 64
    assert versions.firmware.offset == 28 + 64 + 24 + 64
    assert versions.too_old_headset.offset == 192
    assert ctypes.sizeof(versions) >= 196 + 200


def test_data_of_an_uncalibrated_tracker_are_missing_as_the_header_calls_them_invalid():
    _, row, codes = decoded(l_code=1004, r_code=1004, c_code=1004)
    assert not row["valid"]
    assert np.isnan(row["direction_head"]).all()
    assert codes == {1004}

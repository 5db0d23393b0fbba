"""EyeLink: golden samples, and the driver over a stand-in of pylink's surface (no real unit)."""

import types

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.contracts import DeviceState
from devices.drivers.eyelink import codec
from devices.drivers.eyelink import library as eyelink_library
from devices.drivers.eyelink.driver import EyeLink
from devices.drivers.eyelink.library import EyeLinkLibrary
from devices.drivers.streaming.gaze_rays import Screen, rows_to_values
from devices.pump import Pump
from devices.sim.eyelink import EyeLinkSimulator, FakePylink
from lab.clock import NS_PER_S, SimClock
from lab.errors import DeviceError, DeviceNotFound
from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig

SCREEN = Screen(500.0, 300.0, 600.0)
PX = (1000, 600)


def row_of(time_ms, eyes, *numbers):
    raw = codec.SAMPLE.pack(time_ms, eyes, *numbers)
    sample = codec.decode_sample(raw, SCREEN, PX, 0.03, 0.001)
    return None if sample is None else (sample, rows_to_values([sample.row])[0])


def test_pixels_and_milliseconds_become_rays_and_nanoseconds():
    sample, row = row_of(1234.5, 3, 500.0, 300.0, 3500.0, 1000.0, 0.0, 4000.0)

    assert sample.t_device_ns == 1_234_500_000
    left, right = np.array([0.03, 0.0, -0.6]), np.array([0.22, 0.15, -0.6])
    np.testing.assert_allclose(row["left_direction_head"], left / np.linalg.norm(left), atol=1e-6)
    np.testing.assert_allclose(
        row["right_direction_head"], right / np.linalg.norm(right), atol=1e-6
    )
    assert (row["left_pupil_mm"], row["right_pupil_mm"]) == (3.5, 4.0)


@pytest.mark.parametrize("missing", [-32768.0, 32767.0])
def test_missing_marks_are_nan_never_a_place(missing):
    _, row = row_of(1.0, 3, missing, missing, 0.0, 500.0, 300.0, 3000.0)

    assert np.isnan(row["left_direction_head"]).all()
    assert np.isnan(row["left_pupil_mm"])
    assert row["eyes_used"] == 2


def test_one_eyed_tracking_uses_that_eye():
    _, row = row_of(1.0, 1, 500.0, 300.0, 3000.0, 500.0, 300.0, 3000.0)

    assert (row["left_valid"], row["right_valid"], row["eyes_used"]) == (True, False, 1)


def test_unknown_time_is_refused():
    assert row_of(4_294_967_295.0, 3, *[1.0] * 6) is None


@given(st.binary(max_size=90) | st.binary(min_size=57, max_size=57))
def test_any_bytes_are_read_or_refused(raw):
    codec.decode_sample(raw, SCREEN, PX, 0.03, 0.001)


def test_markers_are_one_short_line_of_ascii():
    assert codec.message_text("trial\n1 – näh") == "trial 1 ? n?h"
    assert len(codec.message_text("x" * 500)) == 130


def test_pupil_is_unknown_without_the_labs_own_scale():
    rig = GazeRig(EyeLink, EyeLinkSimulator).start().run(0.2)

    assert np.isnan(rig.column("left_pupil_mm")).all()
    assert "pupil" not in rig.driver.info.capabilities


def test_host_that_was_not_calibrated_is_told():
    rig = GazeRig(EyeLink, EyeLinkSimulator, calibrated=False).start()

    assert "not calibrated" in rig.messages()
    assert not rig.driver.calibration.succeeded


class Lab:
    def __init__(self):
        self.clock = SimClock()
        self.simulator = EyeLinkSimulator(
            FixatingBody(5.0, 3.0), clock=self.clock, seed=1, error=PERFECT
        )
        self.library = FakePylink(self.simulator, self.clock)

    def driver(self, edf_path=None):
        wire = EyeLinkLibrary(
            "100.1.1.1", self.clock, library=self.library, edf_path=edf_path, is_simulated=True
        )
        return EyeLink("eyes", wire, self.clock, pupil_mm_per_unit=0.001)


def test_surface_of_pylink_keeps_the_contract():
    lab = Lab()

    gaze_rigs.keeps_the_contract(lab.driver, gaze_rigs.let_pass_on(lab.clock))


def test_marker_and_file_reach_the_right_place(tmp_path):
    lab = Lab()
    driver = lab.driver(tmp_path / "pilot.edf")
    driver.open(2.0)
    driver.annotate("trial 1", lab.clock.now_ns() - 2_000_000)
    driver.close()

    assert lab.simulator.messages == ["-2.0 trial 1"]
    assert (tmp_path / "pilot.edf").exists()
    assert driver.info.model.startswith("EYELINK")


def test_broken_link_comes_back_within_two_seconds():
    lab = Lab()
    driver = lab.driver()
    driver.open(2.0)
    pump = Pump(driver, lambda batch: None, lab.clock)
    pump.start()
    back_ns = gaze_rigs.lose_for(lab.simulator, lab.clock, 5.0)
    gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.FAULT)
    gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.STREAMING)

    assert lab.clock.now_ns() - back_ns < 2 * NS_PER_S


def test_missing_and_foreign_libraries_say_what_to_install(monkeypatch):
    def absent(name):
        raise ImportError(name)

    monkeypatch.setattr(eyelink_library.importlib, "import_module", absent)
    with pytest.raises(DeviceNotFound, match=r"pip install visavis\[eyelink\]"):
        eyelink_library.eyelink_library()
    foreign = types.SimpleNamespace()
    monkeypatch.setattr(eyelink_library.importlib, "import_module", lambda name: foreign)
    with pytest.raises(DeviceNotFound, match="pip uninstall pylink pylink-square"):
        eyelink_library.eyelink_library()


def test_tracker_that_is_off_says_what_to_switch_on():
    lab = Lab()
    gaze_rigs.lose_for(lab.simulator, lab.clock, 5.0)

    with pytest.raises(DeviceNotFound, match="switch the EyeLink's host computer on"):
        lab.driver().open(1.0)


def test_calibration_from_here_is_refused():
    rig = GazeRig(EyeLink, EyeLinkSimulator).start()

    with pytest.raises(DeviceError, match="cannot be calibrated from here"):
        rig.driver.begin_calibration()

"""EyeLink: golden samples, and the driver over a stand-in of pylink's surface (no real unit)."""

import types

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.fake_pylink import FakePylink, FakeTracker
from tests.virtual_screen import run_before_a_screen
from visavis.devices import libraries
from visavis.devices.contracts import DeviceState, SessionName
from visavis.devices.drivers.eyelink import camera_setup, codec
from visavis.devices.drivers.eyelink import library as eyelink_library
from visavis.devices.drivers.eyelink.driver import NO_RESULT, EyeLink
from visavis.devices.drivers.eyelink.library import VERDICT, EyeLinkLibrary
from visavis.devices.drivers.eyelink.spec import EyeLinkOptions, PupilScale
from visavis.devices.drivers.eyelink.wiring import WIRINGS
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.pump import Pump
from visavis.devices.sim.eyelink import EyeLinkSimulator
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import ConfigError, DeviceError, DeviceNotFound, DeviceTimeout
from visavis.lab.geometry import angle_deg

SCREEN = Screen(500.0, 300.0, 600.0)
PX = (1000, 600)
THOUSANDTHS = PupilScale(1.0, 1000.0)


def row_of(time_ms, eyes, *numbers, scale=THOUSANDTHS):
    raw = codec.SAMPLE.pack(time_ms, eyes, *numbers)
    sample = codec.decode_sample(raw, SCREEN, PX, 0.03, scale)
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
    codec.decode_sample(raw, SCREEN, PX, 0.03, THOUSANDTHS)


def test_markers_are_one_short_line_of_ascii():
    assert codec.message_text("trial\n1 – näh") == "trial 1 ? n?h"
    assert len(codec.message_text("x" * 500)) == 130


def test_pupil_is_unknown_without_the_labs_own_scale():
    rig = GazeRig(EyeLink, EyeLinkSimulator).start().run(0.2)

    assert np.isnan(rig.column("left_pupil_mm")).all()
    assert "pupil" not in rig.driver.info.capabilities


@pytest.mark.parametrize("pupil_mm", [2.0, 3.0, 5.0, 7.0])
@pytest.mark.parametrize("pupil_size", ["diameter", "area"])
def test_pupil_is_as_wide_as_it_is_by_diameter_and_by_area(pupil_size, pupil_mm):
    lab = Lab()
    lab.simulator.gives_area = pupil_size == "area"
    artificial_units = lab.simulator.pupil_units(5.0)
    options = EyeLinkOptions(
        pupil_size=pupil_size, artificial_pupil_mm=5.0, artificial_pupil_units=artificial_units
    )

    units = lab.simulator.pupil_units(pupil_mm)
    _, row = row_of(1.0, 3, 500.0, 300.0, units, 500.0, 300.0, units, scale=options.pupil_scale)

    assert row["left_pupil_mm"] == pytest.approx(pupil_mm)


@pytest.mark.parametrize("gives_area", [False, True])
def test_tracker_is_told_what_a_pupils_size_is(gives_area):
    lab = Lab()
    wire = EyeLinkLibrary(
        "100.1.1.1", lab.clock, library=lab.library, gives_area=gives_area, is_simulated=True
    )
    wire.open(1.0)

    assert lab.simulator.gives_area is gives_area


def test_pupil_that_no_eye_has_is_told_with_both_numbers():
    scale = PupilScale(5.0, 64.0)
    rig = GazeRig(EyeLink, EyeLinkSimulator, options={"pupil_scale": scale}).start().run(0.5)

    assert "mm, but can only be 1 to 10 mm: was artificial_pupil_units" in rig.messages()


def test_half_a_measurement_of_the_artificial_pupil_is_refused():
    with pytest.raises(ValueError, match="together"):
        EyeLinkOptions(artificial_pupil_mm=5.0)


def test_factor_of_earlier_versions_opens_recordings_but_no_tracker():
    options = EyeLinkOptions(pupil_mm_per_unit=0.00125)
    site = types.SimpleNamespace(options=options, clock=SimClock())

    assert options.pupil_scale.diameter_mm(4000.0) == pytest.approx(5.0)
    with pytest.raises(ConfigError, match="area of a pupil for its diameter"):
        WIRINGS[0].real(site)


def test_host_whose_calibration_failed_is_told():
    rig = GazeRig(EyeLink, EyeLinkSimulator, verdict=1).start()

    assert "not calibrated: poor calibration" in rig.messages()
    assert not rig.driver.calibration.succeeded


def test_no_result_yet_is_no_failed_calibration():
    rig = GazeRig(EyeLink, EyeLinkSimulator, verdict=1000).start()

    assert rig.driver.calibration is None
    assert "has not calibrated since it was connected" in rig.messages()


class Lab:
    def __init__(self):
        self.clock = SimClock()
        self.simulator = EyeLinkSimulator(
            FixatingBody(5.0, 3.0), clock=self.clock, seed=1, error=PERFECT
        )
        self.library = FakePylink(self.simulator, self.clock)

    def driver(self):
        wire = EyeLinkLibrary("100.1.1.1", self.clock, library=self.library, is_simulated=True)
        return EyeLink("eyes", wire, self.clock, pupil_scale=THOUSANDTHS)


def test_surface_of_pylink_keeps_the_contract():
    lab = Lab()

    gaze_rigs.keeps_the_contract(lab.driver, gaze_rigs.let_pass_on(lab.clock))


def test_file_of_the_session_is_opened_marked_and_fetched(tmp_path):
    lab = Lab()
    driver = lab.driver()
    driver.open(2.0)
    driver.begin_recording(SessionName("stare", "S001", 1, 2), tmp_path)
    driver.annotate("trial 1", lab.clock.now_ns() - 2_000_000)
    driver.close()

    # Data Viewer takes the leading whole milliseconds off the message's time.
    expected = ["DISPLAY_COORDS 0 0 1919 1079", "2 trial 1"]
    assert lab.library.files == {"S0011_02.edf": expected}
    assert (tmp_path / "eyes.edf").read_text().splitlines()[1:] == expected
    assert driver.info.model.startswith("EYELINK")


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (SessionName("stare", "S001", 1, 2), "S0011_02"),
        (SessionName("stare", "Pilot12", 3, 1), "OT123_01"),
        (SessionName("stare", "S1", 1, 1), "S11_01"),
    ],
)
def test_file_name_is_one_the_host_takes(name, expected):
    assert codec.edf_name(name) == expected


def test_gaze_is_in_the_pixels_the_tracker_was_told():
    lab = Lab()
    driver = lab.driver()
    driver.open(2.0)
    batches = []
    driver.start(batches.append)
    gaze_rigs.let_pass_on(lab.clock)(0.1)
    driver.poll(0.0)

    expected = FixatingBody(5.0, 3.0).direction
    assert angle_deg(batches[0].values["direction_head"][0].astype("f8"), expected) < 0.2
    assert lab.simulator.display_px == (1920, 1080)


def test_time_is_asked_of_the_tracker_itself():
    lab = Lab()
    driver = lab.driver()
    driver.open(2.0)
    (pair,) = driver.clock_pairs()

    true_ns = lab.simulator.source.device_ns((pair.host_send_ns + pair.host_receive_ns) // 2)
    assert pair.host_receive_ns - pair.host_send_ns >= 200_000
    assert abs(pair.device_ns - true_ns) < 1_000_000


def test_broken_link_leaves_the_file_on_the_host_and_goes_on_in_another(tmp_path):
    lab = Lab()
    driver = lab.driver()
    driver.open(2.0)
    driver.begin_recording(SessionName("stare", "S001", 1, 2), tmp_path)
    pump = Pump(driver, lambda batch: None, lab.clock)
    pump.start()
    gaze_rigs.lose_for(lab.simulator, lab.clock, 5.0)
    gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.FAULT)
    gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.STREAMING)
    pump.stop()
    driver.close()

    assert set(lab.library.files) == {"S0011_02.edf", "S0011_0A.edf"}
    assert [path.name for path in tmp_path.iterdir()] == ["eyes_A.edf"]


def test_every_call_exists_in_the_vendors_library_and_its_dummy_takes_it():
    pylink = pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    dummy = pylink.EyeLink(None)
    try:
        assert dummy.sendCommand(f"screen_pixel_coords = {codec.screen_coordinates(PX)}") == 0
        assert dummy.sendCommand("sample_rate = 1000") == 0
        dummy.setOfflineMode()
        assert dummy.openDataFile("S0011_02.edf") == 0
        assert dummy.sendMessage(codec.delayed_message("trial 1", 2_000_000)) == 0
        assert dummy.startRecording(1, 1, 1, 0) == 0
        assert dummy.requestTime() == 0
        assert dummy.readTime() == 0
        assert dummy.getCalibrationResult() == NO_RESULT
        assert dummy.getNextData() == 0
        dummy.stopRecording()
        dummy.closeDataFile()
    finally:
        dummy.close()
    ours = {name for name in vars(FakeTracker) if not name.startswith("_")}
    assert not {name for name in ours if not hasattr(pylink.EyeLink, name)}


class DummySaysConnected:
    """The vendor's own dummy tracker, but connected; notes each call with what it returned."""

    def __init__(self, dummy):
        self._dummy = dummy
        self.calls = []

    def isConnected(self):  # noqa: N802 - the library's name
        return 1

    def __getattr__(self, name):
        def call(*given):
            answer = getattr(self._dummy, name)(*given)
            self.calls.append((name, given, answer))
            return answer

        return call


def test_our_wire_runs_through_a_session_on_the_vendors_own_dummy(tmp_path):
    pylink = pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    tracker = DummySaysConnected(pylink.EyeLink(None))
    library = types.SimpleNamespace(EyeLink=lambda address: tracker)
    wire = EyeLinkLibrary(
        "100.1.1.1", SimClock(), screen_px=PX, rate_hz=500.0, library=library, is_simulated=True
    )
    path = tmp_path / "eyes.edf"

    wire.open(1.0)
    assert wire.request((b"version",), 0.1).frames == (b"version", b"")
    assert wire.request((b"verdict",), 0.1).frames == (b"verdict", VERDICT.pack(NO_RESULT))
    wire.request((b"record", b"S0011_02", str(path).encode()), 0.1)
    wire.send(0, (b"2 trial 1",))
    assert wire.receive(0.001) == []
    with pytest.raises(DeviceTimeout, match="does not tell its time"):  # the dummy has no clock
        wire.request((b"time",), 0.001)
    wire.close()

    asked = {"readTime", "getNextData", "requestTime"}
    assert [call for call in tracker.calls if call[0] not in asked] == [
        ("setOfflineMode", (), None),
        ("sendCommand", ("screen_pixel_coords = 0 0 999 599",), 0),
        ("sendCommand", ("sample_rate = 500",), 0),
        ("sendCommand", ("pupil_size_diameter = YES",), 0),
        ("sendCommand", ("link_sample_data = LEFT,RIGHT,GAZE,AREA,STATUS",), 0),
        (
            "sendCommand",
            ("file_event_filter = LEFT,RIGHT,FIXATION,SACCADE,BLINK,MESSAGE,BUTTON,INPUT",),
            0,
        ),
        (
            "sendCommand",
            ("file_sample_data = LEFT,RIGHT,GAZE,AREA,GAZERES,HREF,STATUS,INPUT",),
            0,
        ),
        ("startRecording", (0, 0, 1, 0), 0),
        ("getTrackerVersionString", (), ""),
        ("getCalibrationMessage", (), ""),
        ("getCalibrationResult", (), NO_RESULT),
        ("stopRecording", (), None),
        ("setOfflineMode", (), None),
        ("openDataFile", ("S0011_02.edf",), 0),
        ("sendMessage", ("DISPLAY_COORDS 0 0 999 599",), 0),
        ("startRecording", (1, 1, 1, 0), 0),
        ("sendMessage", ("2 trial 1",), 0),
        ("stopRecording", (), None),
        ("setOfflineMode", (), None),
        ("closeDataFile", (), 0),
        ("receiveDataFile", ("S0011_02.edf", str(path)), 0),
        ("close", (), 0),
    ]
    assert asked <= {name for name, _, _ in tracker.calls}


class PaperScreen:
    """A screen that only notes what is drawn, and on which Esc is pressed at the third question."""

    size_px = (1000, 600)

    def __init__(self):
        self.shown = []
        self.asked = 0
        self.is_closed = False

    def show(self, target_px):
        self.shown.append(target_px)

    def keys(self):
        self.asked += 1
        return (27,) if self.asked >= 3 else ()

    def close(self):
        self.is_closed = True


def test_vendors_own_setup_draws_through_our_screen_and_takes_its_keys():
    pylink = pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    screen = PaperScreen()

    assert camera_setup.set_up(None, screen, pylink) == "nothing was calibrated"
    assert screen.shown == [None, None]  # the dummy has no targets
    assert screen.asked >= 3
    assert screen.is_closed


def test_a_target_is_dark_where_it_is_asked_for_and_nothing_is_where_none_is():
    pictures = run_before_a_screen("tests.devices.target_screen_child", size_px=(640, 480))

    # a black square of ten pixels around a white one of two
    assert pictures.splitlines() == ["96 500.0 30.0", "0"]


def test_target_is_drawn_where_the_tracker_says():
    pylink = pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    screen = PaperScreen()
    display = camera_setup.display_on(pylink, screen)

    display.draw_cal_target(500, 30)
    display.erase_cal_target()

    assert screen.shown == [(500, 30), None]


def test_dummy_of_the_vendors_library_is_no_tracker():
    pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    wire = EyeLinkLibrary(None, SimClock(), is_simulated=True)

    with pytest.raises(DeviceError, match="not connected"):
        EyeLink("eyes", wire, SimClock()).open(1.0)


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

    monkeypatch.setattr(libraries.importlib, "import_module", absent)
    with pytest.raises(DeviceNotFound, match=r"pip install 'visavis\[eyelink\]'"):
        eyelink_library.eyelink_library()
    foreign = types.SimpleNamespace()
    monkeypatch.setattr(libraries.importlib, "import_module", lambda name: foreign)
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


# ---- within a session: the host leads a calibration, and shifts gaze -------------------------


def calibrated_by_host(rig):
    """Let the host calibrate; return the directions in which it wanted a target."""
    rig.driver.lead_calibration()
    wanted = []
    for _ in range(1200):
        rig.run(1 / 90)
        target = rig.driver.wanted_target()
        if target is not None and not (wanted and np.array_equal(wanted[-1], target)):
            wanted.append(target)
        if rig.driver.calibration_verdict() is not None:
            return wanted
    raise AssertionError("the host came to no end")


def screen_options(**others):
    return {"options": {"screen": SCREEN, "screen_px": PX, **others}, "screen": SCREEN}


def test_the_host_says_where_its_targets_belong_and_silence_meanwhile_is_no_fault():
    rig = GazeRig(EyeLink, EyeLinkSimulator, screen_px=PX, **screen_options()).start().run(0.5)
    before = len(rig.stamps("seq"))
    wanted = calibrated_by_host(rig)
    assert len(rig.stamps("seq")) <= before + 20  # none while the host calibrates

    assert len(wanted) == 9
    # the outermost targets stand 0.35 of the screen from its middle: 175 and 105 mm, 600 mm away
    corner = np.array([-0.175, 0.105, -0.6]) / np.linalg.norm([0.175, 0.105, 0.6])
    assert min(angle_deg(np.array(wanted), corner)) < 0.1
    assert rig.driver.calibration_verdict().succeeded
    assert rig.kinds() == []
    rig.run(0.5)
    assert len(rig.stamps("seq")) > before + 300
    assert "no data" not in rig.messages()


def test_a_host_that_comes_to_no_end_is_left_and_told(monkeypatch):
    monkeypatch.setattr("visavis.devices.drivers.eyelink.driver.SETUP_WITHIN_NS", 2 * NS_PER_S)
    rig = GazeRig(EyeLink, EyeLinkSimulator, screen_px=PX, **screen_options()).start().run(0.2)
    rig.driver.lead_calibration()
    rig.run(3.0)
    verdict = rig.driver.calibration_verdict()
    assert not verdict.succeeded
    assert verdict.message == "the host did not finish within 2 s"
    assert not rig.driver.is_paused


def test_a_bad_calibration_at_the_host_is_its_verdict():
    rig = GazeRig(EyeLink, EyeLinkSimulator, screen_px=PX, **screen_options()).start().run(0.2)
    rig.simulator.verdict = 1
    calibrated_by_host(rig)
    assert not rig.driver.calibration_verdict().succeeded
    assert "poor calibration" in rig.driver.calibration_verdict().message


def test_the_library_stops_recording_presses_c_and_enter_and_records_on(tmp_path):
    lab = Lab()
    driver = lab.driver()
    driver.open(1.0)
    driver.begin_recording(SessionName("stare", "S001", 1, 1), tmp_path)
    pump = Pump(driver, lambda batch: None, lab.clock)
    pump.start()
    tracker = driver._transport._tracker
    driver.lead_calibration()
    assert not tracker.recording
    while driver.calibration_verdict() is None:
        lab.clock.sleep_until_ns(lab.clock.now_ns() + NS_PER_S // 90)
        pump.step()
    assert tracker.keys == [ord("c"), 13]
    assert tracker.recording
    driver.annotate("after", lab.clock.now_ns())
    assert [m.partition(" ")[2] for m in lab.library.files["S0011_01.edf"]][-1] == "after"
    pump.stop()
    driver.close()


def test_drift_is_corrected_only_where_it_is_allowed():
    aim = np.array([0.0, 0.0, -1.0])
    rig = GazeRig(EyeLink, EyeLinkSimulator, screen_px=PX, **screen_options()).start().run(0.2)
    assert rig.driver.correct_drift(aim).message == "not corrected: drift_correction is off"
    assert rig.simulator.drift_px == []

    options = screen_options(drift_correction=True)
    rig = GazeRig(EyeLink, EyeLinkSimulator, screen_px=PX, **options).start().run(0.2)
    assert rig.driver.correct_drift(aim).succeeded
    assert rig.simulator.drift_px == [(500, 300)]
    rig.simulator.drift_code = 3
    outcome = rig.driver.correct_drift(aim)
    assert not outcome.succeeded
    assert outcome.message == "gaze was further off than the host corrects"


def test_our_wire_calibrates_and_corrects_on_the_vendors_own_dummy():
    pylink = pytest.importorskip("pylink", reason="sr-research-pylink is not installed")
    assert (pylink.KB_PRESS, pylink.ENTER_KEY) == (eyelink_library.KEY_PRESS, eyelink_library.ENTER)
    tracker = DummySaysConnected(pylink.EyeLink(None))
    library = types.SimpleNamespace(EyeLink=lambda address: tracker)
    wire = EyeLinkLibrary(
        "100.1.1.1", SimClock(), library=library, corrects_drift=True, is_simulated=True
    )
    wire.open(1.0)
    tracker.calls.clear()
    wire.request((b"setup",), 0.1)
    target = wire.request((b"target",), 0.1).frames[1]
    assert codec.TARGET.unpack(target)[3] == NO_RESULT
    wire.request((b"leave",), 0.1)
    wire.request((b"drift", b"960 540"), 0.001)
    wire.close()
    assert [name for name, _, _ in tracker.calls][:6] == [
        "stopRecording",
        "setOfflineMode",
        "enableAutoCalibration",
        "startSetup",
        "waitForModeReady",
        "sendKeybutton",
    ]
    assert ("sendCommand", ("online_dcorr_trigger 960 540",), 0) in tracker.calls

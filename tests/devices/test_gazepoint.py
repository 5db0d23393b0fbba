"""Gazepoint: golden lines, any chunking, calibration, markers, and real sockets."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices import gaze_rigs
from tests.devices.bodies import FixatingBody
from tests.devices.gaze_rigs import PERFECT, GazeRig
from tests.devices.wire_ends.gazepoint_host import GazepointHost
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.gazepoint import codec
from visavis.devices.drivers.gazepoint.driver import Gazepoint
from visavis.devices.drivers.gazepoint.spec import REMEDY
from visavis.devices.drivers.links.stream_socket import StreamSocket
from visavis.devices.drivers.streaming.gaze_rays import rows_to_values
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.faults import FaultSchedule
from visavis.devices.sim.gazepoint import GazepointSimulator
from visavis.lab.clock import SystemClock
from visavis.lab.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceNotFound,
    DeviceTimeout,
    ProtocolViolation,
)

PLACE = codec.Place(Screen(500.0, 300.0, 600.0))
RECORD = (
    b'<REC CNT="72" TIME="1.20000" TIME_TICK="12000005" LPOGX="0.50000" LPOGY="0.50000" '
    b'LPOGV="1" RPOGX="1.00000" RPOGY="0.00000" RPOGV="1" LEYEX="-0.03000" LEYEY="0.18000" '
    b'LEYEZ="0.60000" LPUPILD="0.00412" LPUPILV="1" REYEX="0.03000" REYEY="0.18000" '
    b'REYEZ="0.70000" RPUPILD="0.00300" RPUPILV="1" USER="go" />\r\n'
)


def row_of(raw):
    (line,) = codec.LineReader().feed(raw)
    sample = codec.decode_record(line.values, PLACE, 10_000_000)
    return sample, rows_to_values([sample.row])[0]


def test_commands_are_written_as_the_server_reads_them():
    line = codec.set_line("ENABLE_SEND_DATA", STATE="1")

    assert line == b'<SET ID="ENABLE_SEND_DATA" STATE="1" />\r\n'
    assert codec.get_line("API_ID") == b'<GET ID="API_ID" />\r\n'


def test_tick_is_the_device_time_and_cnt_the_counter():
    sample, _ = row_of(RECORD)

    assert (sample.t_device_ns, sample.counter) == (1_200_000_500, 72)


def test_point_on_the_screen_and_eye_position_make_a_ray():
    _, row = row_of(RECORD)

    left = np.array([0.03, 0.0, -0.6])  # from (-30 mm, 0, 0) to the centre of the screen
    right = np.array([0.25 - 0.03, 0.15, -0.7])  # from (30, 0, 100 mm) to its top right corner
    np.testing.assert_allclose(row["left_direction_head"], left / np.linalg.norm(left), atol=1e-6)
    np.testing.assert_allclose(
        row["right_direction_head"], right / np.linalg.norm(right), atol=1e-6
    )
    np.testing.assert_allclose(row["origin_m"], (0.0, 0.0, 0.05), atol=1e-6)


def test_pupil_is_metres_on_the_wire():
    _, row = row_of(RECORD)

    assert row["left_pupil_mm"] == pytest.approx(4.12)
    assert row["right_pupil_mm"] == pytest.approx(3.0)


def test_invalid_point_is_missing_never_the_corner():
    _, row = row_of(RECORD.replace(b'LPOGV="1"', b'LPOGV="0"'))

    assert np.isnan(row["left_direction_head"]).all()
    assert (row["left_valid"], row["eyes_used"], row["valid"]) == (False, 2, True)


def test_best_point_alone_still_makes_gaze():
    _, row = row_of(b'<REC TIME="2.0" BPOGX="0.5" BPOGY="0.5" BPOGV="1" />\r\n')

    np.testing.assert_allclose(row["direction_head"], (0, 0, -1), atol=1e-6)
    assert np.isnan(row["left_direction_head"]).all()


def test_quotes_and_angles_in_a_marker_are_escaped():
    line = codec.set_line("USER_DATA", VALUE='a"<b>&', DUR="1")

    assert line == b'<SET ID="USER_DATA" VALUE="a&quot;&lt;b&gt;&amp;" DUR="1" />\r\n'


@given(st.lists(st.integers(1, 60), max_size=40), st.integers(1, 5))
def test_any_chunking_gives_the_same_lines(cuts, copies):
    stream = RECORD * copies
    reader = codec.LineReader()
    found = []
    at = 0
    for size in [*cuts, len(stream)]:
        found += reader.feed(stream[at : at + size])
        at += size
    assert len(found) == copies
    assert reader.malformed == 0


@given(st.binary(max_size=400), st.integers(0, 300), st.integers(0, 255))
def test_damaged_lines_never_raise(noise, place, byte):
    damaged = bytearray(RECORD)
    damaged[place % len(damaged)] = byte
    reader = codec.LineReader()
    for line in reader.feed(noise + b"\n" + bytes(damaged) + b"\n"):
        codec.decode_record(line.values, PLACE, 10_000_000)
        codec.calibration_errors_deg(line.values, PLACE.screen)


def test_endless_line_is_given_up():
    reader = codec.LineReader()
    for _ in range(20):
        reader.feed(b"x" * 10_000)

    assert reader.malformed >= 2


def test_calibration_result_gives_an_error_in_degrees():
    rig = GazeRig(Gazepoint, GazepointSimulator).start().run(0.3)
    rig.driver.begin_calibration()

    outcome = rig.driver.end_calibration(5.0)

    assert outcome.succeeded
    assert 0.0 < outcome.vendor_accuracy_deg < 1.0
    assert outcome.message == "10 of 10 targets counted (two eyes)"


def test_calibration_with_closed_eyes_fails():
    rig = GazeRig(Gazepoint, GazepointSimulator).start().run(0.3)
    rig.body.openness_01 = 0.0
    rig.driver.begin_calibration()

    assert not rig.driver.end_calibration(5.0).succeeded


def test_marker_reaches_the_server():
    rig = GazeRig(Gazepoint, GazepointSimulator).start().run(0.3)

    rig.driver.annotate("trial 1", rig.clock.now_ns())

    assert list(rig.simulator.annotations) == ["trial 1"]


def test_old_interface_is_refused_by_name():
    rig = GazeRig(Gazepoint, GazepointSimulator, {"kind": "version", "text": "1.0"})

    with pytest.raises(ProtocolViolation, match=r"Open Gaze '1\.0'; this driver needs 2\.0"):
        rig.driver.open(2.0)


@pytest.mark.parametrize(
    ("text", "ticks_per_s"),
    [
        ("4704405731611246592", 3_330_093.0),  # the example in the vendor's document, 3.13
        ("10000000", 10_000_000.0),
        ("1000000000", 1e9),
        ("4", None),
        ("99999999999999999999", None),
        ("nonsense", None),
    ],
)
def test_frequency_is_read_as_a_number_or_as_the_bits_of_a_double(text, ticks_per_s):
    assert codec.tick_frequency(text) == ticks_per_s


def test_ten_seconds_of_ticks_are_ten_seconds():
    rig = GazeRig(Gazepoint, GazepointSimulator, ticks_per_s=3_330_093).start().run(10.0)

    stamps = rig.stamps("t_device_ns")
    assert (stamps[-1] - stamps[0]) / 1e9 == pytest.approx(10.0, abs=0.1)


def test_clock_that_counts_other_seconds_blocks_and_names_both():
    rig = GazeRig(Gazepoint, GazepointSimulator, ticks_per_s=3_330_093)
    rig.simulator.ticks_per_s = 3_330_093
    rig.start()
    rig.driver._ticks_per_s = 10_000_000  # as where the server states another clock's rate
    rig.run(10.0)

    assert "its clock counts 0.333 s in 1 s of this computer" in rig.messages()


def test_implausible_frequency_is_named_and_seconds_are_used():
    rig = GazeRig(Gazepoint, GazepointSimulator, ticks_per_s=7)
    rig.start().run(5.0)

    assert "which can only be 1000 to 1e+10" in rig.messages()
    assert np.ptp(rig.stamps("t_device_ns")) / 1e9 == pytest.approx(5.0, abs=0.1)


def test_rate_that_differs_from_the_tracker_s_own_is_named():
    rig = GazeRig(Gazepoint, GazepointSimulator, rate_hz=150.0).start().run(1.0)

    assert "measures 150 times a second, lab_config.yaml says 60" in rig.messages()


def test_server_that_switches_between_trackers_is_refused():
    rig = GazeRig(Gazepoint, GazepointSimulator, trackers=2)

    with pytest.raises(DeviceError, match=r"2 trackers and switches between them .*GAZE"):
        rig.driver.open(2.0)


def test_lost_records_are_holes_in_seq():
    rig = GazeRig(Gazepoint, GazepointSimulator, {"kind": "loss", "amount": 0.05})
    rig.start().run(10.0)

    lost = int((np.diff(rig.stamps("seq")) - 1).sum())
    assert lost > 10
    assert f"{lost} samples were lost" in rig.messages()


class Lab:
    def __init__(self, *faults, reads=True):
        self.clock = SystemClock()
        schedule = FaultSchedule.from_config(faults)
        simulator = GazepointSimulator(
            FixatingBody(5.0, 3.0), clock=self.clock, seed=1, error=PERFECT, faults=schedule
        )
        self.simulator = simulator
        self.host = GazepointHost(simulator, self.clock, reads=reads)

    def driver(self):
        wire = StreamSocket(
            "127.0.0.1", self.host.port, self.clock, remedy=REMEDY, is_simulated=True
        )
        return Gazepoint("eyes", wire, self.clock, lost_after_s=0.5)


def test_real_sockets_keep_the_contract():
    lab = Lab()
    with lab.host:
        gaze_rigs.keeps_the_contract(lab.driver, gaze_rigs.let_pass_on(lab.clock))


def test_server_that_goes_away_comes_back_within_two_seconds():
    lab = Lab()
    with lab.host:
        driver = lab.driver()
        driver.open(5.0)
        with gaze_rigs.pumped(driver, lab.clock) as (pump, batches):
            gaze_rigs.step_until(lab.clock, pump, lambda: bool(batches))
            back_ns = gaze_rigs.lose_for(lab.simulator, lab.clock, 0.8)
            gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.FAULT)
            gaze_rigs.step_until(lab.clock, pump, lambda: driver.state is DeviceState.STREAMING)
            events = pump.take_events()
            pump.step()
    assert events[-1].kind == "reconnected"
    assert events[-1].t_ns - back_ns < 2 * 10**9


def test_nobody_listening_says_what_to_start():
    clock = SystemClock()
    wire = StreamSocket("127.0.0.1", 1, clock, remedy=REMEDY)

    with pytest.raises(DeviceNotFound, match="start Gazepoint Control"):
        Gazepoint("eyes", wire, clock).open(1.0)


def test_peer_that_accepts_and_never_answers_times_out():
    lab = Lab(reads=False)
    with lab.host, pytest.raises(DeviceTimeout, match="no answer from the server in time"):
        lab.driver().open(0.2)


def test_write_to_a_peer_that_never_reads_times_out():
    lab = Lab(reads=False)
    with lab.host:
        wire = StreamSocket("127.0.0.1", lab.host.port, lab.clock)
        wire.open(1.0)
        with pytest.raises(DeviceTimeout, match="a write timed out"):
            wire.post((b"x" * 64_000_000,))
        wire.close()
        with pytest.raises(DeviceDisconnected):
            wire.post((b"x",))

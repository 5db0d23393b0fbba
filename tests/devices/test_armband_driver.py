"""What the armband's driver promises, on a simulated link and on a pseudo-terminal."""

import itertools
import os

import numpy as np
import pytest

from tests.devices.band_makers import serial_armband
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import (
    BAND,
    CONTACT_PATTERN,
    HAPTICS,
    NO_DEVICE_TIME,
    DeviceState,
    VibrationPattern,
)
from visavis.devices.drivers.armband import codec
from visavis.devices.drivers.armband.ledger import DeviceMicros
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.sim.armband.simulator import ArmbandSimulator, serial_of
from visavis.experiments.crowd.haptics import BAND_ROLES
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock
from visavis.lab.clock_fit import fit_clock
from visavis.lab.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceNotFound,
    DeviceTimeout,
    ProtocolViolation,
)

ON = (1.0, 0.5, 0.0, 0.25)
OFF = (0, 0, 0, 0)


class Band:
    """One simulated band, polled at 90 Hz on a virtual clock."""

    def __init__(self, *faults, **simulator):
        self.clock = SimClock()
        schedule = FaultSchedule.from_config(faults)
        self.peer = ArmbandSimulator("arm", self.clock, seed=3, faults=schedule, **simulator)
        self.driver = serial_armband("arm", self.clock, link=MemoryLink(self.peer, self.clock))
        self.batches = []

    def start(self):
        self.driver.open(2.0)
        self.driver.start(self.batches.append)
        return self

    def run(self, seconds, *, alive=True, each=None):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 90)
            if alive:
                self.driver.keep_alive()
            if each is not None:
                each()
            self.driver.poll(0.0)
        return self

    def rows(self, kind=None):
        found = [b.values for b in self.batches if b.schema is HAPTICS]
        values = np.concatenate(found) if found else np.zeros(0, HAPTICS.dtype)
        return values if kind is None else values[values["kind"] == kind]

    def events(self):
        return [int(e) for b in self.batches if b.schema is BAND for e in b.values["event"] if e]

    @property
    def duties(self):
        self.peer.advance(self.clock.now_ns())
        return self.peer.firmware.duties


def test_open_tells_firmware_serial_and_range():
    band = Band().start()

    assert band.driver.info.serial == serial_of("arm")
    assert band.driver.info.model == "armband (firmware 1.1)"
    assert band.driver.rate_range_hz == (57.0, 126.0)
    assert band.driver.state is DeviceState.STREAMING


def test_simulated_bands_worn_together_have_serial_numbers_of_their_own():
    assert 4 == len({serial_of(role) for role in BAND_ROLES})


def test_set_amplitudes_drives_the_motors_and_is_acknowledged():
    band = Band().start()
    number = band.driver.set_amplitudes(ON, 500)
    band.run(0.1)

    row = band.rows(0)[0]
    assert (number, True) == (row["command"], row["acknowledged"])
    np.testing.assert_allclose(row["amplitudes_01"], ON)
    assert band.duties == (255, 185, 0, 150)


def test_a_command_bears_the_arrival_of_its_answer_and_the_bands_own_time_of_applying_it():
    band = Band(latency_ms=20.0, jitter_ms=0.0).start()
    band.driver.set_amplitudes(ON, 500)
    band.run(0.1)
    band.driver.set_amplitudes(ON, 500)
    band.run(0.1)

    batches = [b for b in band.batches if b.schema is HAPTICS]
    rows = band.rows()
    sets = rows["kind"] == 0
    there_and_back_ns = (np.concatenate([b.t_host_ns for b in batches]) - rows["t_sent_ns"])[sets]
    assert (there_and_back_ns >= 40 * NS_PER_MS).all()
    assert (there_and_back_ns < 60 * NS_PER_MS).all()  # with the bytes on a slow wire
    applied_ns = np.concatenate([b.t_device_ns for b in batches])[sets]
    asked_ns = rows["t_commanded_ns"][sets]
    assert np.diff(applied_ns).tolist() == pytest.approx(np.diff(asked_ns).tolist(), abs=NS_PER_MS)


def test_rates_set_the_duty_and_amplitude_only_switches():
    band = Band().start()
    band.driver.set_amplitudes(ON, 500, rates_hz=(57, 126, 100, 91.5))
    band.run(0.1)

    low, high, off, middle = band.duties
    assert (low, high, off) == (115, 255, 0)
    assert middle == pytest.approx(185, abs=2)


def test_motors_fall_silent_when_the_time_to_live_ends():
    band = Band().start()
    band.driver.set_amplitudes(ON, 200)
    band.run(0.15)
    assert any(band.duties)
    band.run(0.1)
    assert band.duties == (0, 0, 0, 0)


def test_refresh_keeps_a_setting_beyond_the_dead_man():
    band = Band().start()
    band.driver.set_amplitudes(ON, 2000)
    band.run(1.5)
    assert any(band.duties)
    assert 2 not in band.events()


def test_silence_is_at_once_and_acknowledged():
    band = Band().start()
    band.driver.set_amplitudes(ON, 2000)
    band.run(0.1)
    band.driver.silence()
    band.run(0.02)
    assert band.duties == (0, 0, 0, 0)
    assert band.rows(2)["acknowledged"].tolist() == [True]


def test_hung_experiment_loop_silences_although_polling_goes_on():
    band = Band().start()
    band.driver.set_amplitudes(ON, 5000)
    band.run(0.1)
    band.run(0.2, alive=False)
    assert band.duties == (0, 0, 0, 0)
    assert "stood still" in band.driver.check()[0].message


def test_host_that_falls_quiet_is_followed_by_the_dead_man():
    band = Band().start()
    band.driver.set_amplitudes(ON, 5000)
    band.run(0.1)
    band.clock.sleep_until_ns(band.clock.now_ns() + 260 * NS_PER_MS)
    assert band.duties == (0, 0, 0, 0)


def test_pattern_swings_ten_times_a_second_within_the_pilot_range():
    band = Band().start()
    band.driver.play(CONTACT_PATTERN, (0, 2))
    band.run(1.0)

    duties = np.array([d for _, d in band.peer.duty_log])
    assert (duties[:, [1, 3]] == 0).all()
    swinging = duties[duties[:, 0] > 0, 0]
    assert (swinging.min(), swinging.max()) == (115, 255)
    stamps = np.array([t for t, d in band.peer.duty_log if d[0]])
    rising = np.flatnonzero((swinging[:-1] < 185) & (swinging[1:] >= 185))
    np.testing.assert_allclose(np.diff(stamps[rising]) / 1e6, 100, atol=3)


def test_pattern_ends_by_itself_and_is_felt_once_despite_lost_answers():
    band = Band({"kind": "mute", "start_s": 0.5, "duration_s": 0.5}).start()
    band.clock.sleep_until_ns(round(0.6e9))
    band.driver.play(VibrationPattern("steady", 100), (0,))
    band.run(0.6)
    edges = [d[0] for _, d in band.peer.duty_log]
    assert edges.count(255) == 1
    assert band.rows(1)["acknowledged"].tolist() == [False]


def test_commands_lost_on_the_way_are_repaired_by_the_refresh():
    band = Band({"kind": "loss", "amount": 0.3, "start_s": 0.5}).start()
    band.run(0.5)
    band.driver.set_amplitudes(ON, 5000)
    band.run(2.0)
    band.driver.silence()
    band.run(0.3)
    assert band.duties == (0, 0, 0, 0)


def test_band_that_goes_away_is_told_once_and_comes_back_with_a_gap():
    band = Band({"kind": "disconnect", "start_s": 1.0, "duration_s": 1.0}).start()
    with pytest.raises(DeviceDisconnected):
        band.run(1.5)
    assert band.driver.state is DeviceState.FAULT
    lost = band.driver.set_amplitudes(ON, 500)
    band.run(1.5)
    assert band.driver.state is DeviceState.STREAMING
    assert not band.rows()[band.rows()["command"] == lost]["acknowledged"].any()
    band.driver.set_amplitudes(ON, 500)
    band.run(0.1)
    assert any(band.duties)


def test_newer_setting_takes_the_place_of_one_that_waits():
    band = Band().start()
    for amplitude in (0.1, 0.2, 0.3):
        band.driver.set_amplitudes((amplitude,) * 4, 500)
    band.run(0.1)

    rows = {int(row["command"]): row for row in band.rows(0)}
    assert [True, False, True] == [bool(rows[number]["acknowledged"]) for number in range(3)]
    assert rows[1]["t_sent_ns"] == NO_DEVICE_TIME
    assert band.duties == (157,) * 4


def test_band_that_stops_answering_counts_as_gone_and_comes_back():
    band = Band({"kind": "mute", "start_s": 1.0, "duration_s": 2.0}).start()
    with pytest.raises(DeviceDisconnected, match="no answer"):
        band.run(2.9)
    band.run(1.5)
    assert band.driver.state is DeviceState.STREAMING


def test_band_that_lost_its_arming_is_armed_again():
    band = Band().start()
    band.run(0.2)
    band.peer.firmware.feed(codec.encode_arm(99, False), 0)
    band.driver.set_amplitudes(ON, 500)
    with pytest.raises(DeviceDisconnected, match="no longer armed"):
        band.run(0.2)
    band.run(0.5)
    band.driver.set_amplitudes(ON, 500)
    band.run(0.1)
    assert any(band.duties)


def test_pause_without_polling_is_no_loss():
    band = Band().start()
    band.run(0.5)
    band.clock.sleep_until_ns(band.clock.now_ns() + 30 * NS_PER_S)
    band.run(0.5)
    assert band.driver.state is DeviceState.STREAMING
    assert band.driver.check() == ()


def test_device_time_goes_on_over_the_wrap_of_its_counter():
    micros = DeviceMicros()
    stamps = [micros.unwrap_ns(us) for us in (2**32 - 10, 2**32 - 5, 3, 1, 10)]
    assert [-10, -5, 3, 1, 10] == [stamp // 1000 - 2**32 for stamp in stamps]


def test_wearer_feels_the_motors_with_their_inertia():
    felt = []

    class Skin:
        def stretch(self):
            return 0

        def feel(self, role, amplitudes_01, t_ns):
            felt.append((role, t_ns, amplitudes_01[0]))

    band = Band(body=Skin(), latency_ms=0.0, jitter_ms=0.0).start()
    band.run(0.05)
    asked_ns = band.clock.now_ns()
    band.driver.set_amplitudes((1, 0, 0, 0), 300)
    band.run(0.6)

    levels = {t_ns: level for _, t_ns, level in felt}
    half_ms = (min(t for t, level in levels.items() if level >= 0.5) - asked_ns) / NS_PER_MS
    wire_ms = 19 * 10 / 38.4
    assert half_ms == pytest.approx(wire_ms + 30 * np.log(2), abs=2.5)
    assert max(levels.values()) > 0.97
    assert ("arm", 0.0) == (felt[-1][0], felt[-1][2])
    assert (felt[-1][1] - asked_ns) / NS_PER_MS < 300 + wire_ms + 30 * np.log(50) + 15


@pytest.mark.parametrize("seed", range(8))
def test_eventful_sessions_end_silent_and_motors_never_outlive_their_command(seed):
    rng = np.random.default_rng(seed)
    band = Band()
    band.peer = ArmbandSimulator(
        "arm", band.clock, seed=seed, faults=FaultSchedule.random(rng, 20.0), drift_ppm=40.0
    )
    driver = serial_armband("arm", band.clock, link=MemoryLink(band.peer, band.clock))
    pump = Pump(driver, band.batches.append, band.clock)
    open_despite_faults(driver, band.clock)
    pump.start()
    asked = []
    while band.clock.now_ns() < 20 * NS_PER_S:
        band.clock.sleep_until_ns(band.clock.now_ns() + NS_PER_S // 90)
        driver.keep_alive()
        pump.step()
        if rng.random() < 0.02:
            ttl_ms = int(rng.integers(50, 800))
            asked.append((band.clock.now_ns(), ttl_ms * NS_PER_MS))
            driver.set_amplitudes(ON, ttl_ms)
    driver.silence()
    for _ in range(90):
        band.clock.sleep_until_ns(band.clock.now_ns() + NS_PER_S // 90)
        driver.keep_alive()
        pump.step()

    assert band.duties == OFF
    assert driver.state is DeviceState.STREAMING
    slack_ns = 300 * NS_PER_MS
    for t_ns, duties in band.peer.duty_log:
        if any(duties):
            assert any(at <= t_ns <= at + ttl + slack_ns for at, ttl in asked)
    changes = [*band.peer.duty_log, (band.clock.now_ns(), OFF)]
    for (t_ns, duties), (until_ns, _) in itertools.pairwise(changes):
        if any(duties):
            reaching = max(at + ttl for at, ttl in asked if at <= until_ns)
            assert until_ns <= reaching + slack_ns, (t_ns, until_ns)


def open_despite_faults(driver, clock):
    while driver.state is DeviceState.CLOSED:
        try:
            driver.open(2.0)
        except DeviceError:
            clock.sleep_until_ns(clock.now_ns() + NS_PER_S)


def test_simulation_repeats_bit_for_bit():
    def rows():
        band = Band({"kind": "loss", "amount": 0.2, "start_s": 0.5}).start()
        for _ in range(5):
            band.driver.set_amplitudes(ON, 400)
            band.run(0.3)
        return band.rows().tobytes()

    assert rows() == rows()


def test_pump_that_waits_for_what_is_due_delivers_what_polling_every_frame_does():
    def session(*, every_frame):
        band, polls = Band(), []
        polled = band.driver.poll
        band.driver.poll = lambda timeout_s: polls.append(timeout_s) or polled(timeout_s)
        band.driver.open(2.0)
        pump = Pump(band.driver, band.batches.append, band.clock)
        pump.start()
        for frame in range(900):
            band.clock.sleep_until_ns(band.clock.now_ns() + NS_PER_S // 90)
            band.driver.keep_alive()
            if frame % 300 == 100:
                band.driver.play(CONTACT_PATTERN, (0, 2))
            if frame % 300 == 130:
                band.driver.silence()
            if frame == 300:
                band.driver.set_amplitudes(ON, 500)
            if every_frame:
                band.driver.poll(0.0)
            pump.step()
        rows = [(b.t_host_ns.tolist(), b.seq.tolist(), b.values.tobytes()) for b in band.batches]
        return rows, band.peer.duty_log, len(polls)

    every_rows, every_duties, every_polls = session(every_frame=True)
    rows, duties, polls = session(every_frame=False)

    assert (rows, duties) == (every_rows, every_duties)
    assert polls < every_polls / 2


def test_clock_is_found_within_a_fifth_of_a_millisecond_after_two_minutes_of_drift_and_jitter():
    band = Band({"kind": "drift", "amount": 50.0}, jitter_ms=5.0).start()
    band.run(120.0)
    fit = fit_clock(band.driver.clock_pairs())

    device_ns = round(band.clock.now_ns() * (1 + 50e-6))
    found_ns = int(fit.to_host_ns(np.array([device_ns]))[0])
    assert found_ns == pytest.approx(band.clock.now_ns(), abs=0.2 * NS_PER_MS)


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ({"kind": "late_start", "duration_s": 60}, DeviceNotFound),
        ({"kind": "mute"}, DeviceTimeout),
        ({"kind": "version", "text": "9"}, ProtocolViolation),
    ],
)
def test_open_fails_within_its_deadline_and_says_what_to_do(fault, error):
    band = Band(fault)
    with pytest.raises(error, match=";"):
        band.driver.open(1.0)
    assert band.clock.now_ns() <= 1.1 * NS_PER_S
    assert band.driver.state is DeviceState.CLOSED


@pytest.mark.parametrize(
    "wrong",
    [
        lambda d: d.set_amplitudes((1, 1, 1), 100),
        lambda d: d.set_amplitudes((1, 1, 1, 1.1), 100),
        lambda d: d.set_amplitudes((1, 1, 1, float("nan")), 100),
        lambda d: d.set_amplitudes(ON, 0),
        lambda d: d.set_amplitudes(ON, 100, rates_hz=(57, 57, 57, 130)),
        lambda d: d.play(VibrationPattern("sine", 2001), (0,)),
        lambda d: d.play(CONTACT_PATTERN, (4,)),
    ],
)
def test_commands_outside_the_limits_are_refused(wrong):
    band = Band().start()
    with pytest.raises(DeviceError, match="arm"):
        wrong(band.driver)
    assert band.duties == (0, 0, 0, 0)


def test_close_silences_and_disarms():
    band = Band().start()
    band.driver.set_amplitudes(ON, 5000)
    band.run(0.1)
    band.driver.close()
    assert band.duties == (0, 0, 0, 0)


def test_serial_driver_drives_a_band_on_a_pseudo_terminal():
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    if not hasattr(os, "openpty"):
        pytest.skip("this system has no pseudo-terminals; the memory link covers the driver")
    from tests.devices.wire_ends.armband_pty import PtyArmband

    clock = SystemClock()
    batches = []
    with PtyArmband(clock) as peer:
        driver = serial_armband("arm", clock, port=peer.port)
        driver.open(5.0)
        driver.start(batches.append)
        driver.set_amplitudes(ON, 2000)
        deadline_ns = clock.now_ns() + 5 * NS_PER_S
        while not batches and clock.now_ns() < deadline_ns:
            driver.poll(0.05)
        granted = peer.firmware.granted_duties
        driver.close()
        silent = peer.firmware.duties

    assert (255, 185, 0, 150) == granted
    assert (0, 0, 0, 0) == silent
    assert batches[0].values["acknowledged"][0]

"""What the armband's firmware promises, the same on the AVR image, on its C, and in Python."""

import itertools
import json
import subprocess

import numpy as np
import pytest

from tests.devices.wire_ends.armband_machine import LockstepMachine, build
from visavis.devices.drivers.armband import codec
from visavis.lab.errors import DeviceNotFound

MS = 1000
FULL = (255, 255, 255, 255)
OFF = (0, 0, 0, 0)
ANSWER_WITHIN_MS = 20
NOISE_MS = 12


class Host:
    """Sends commands one after the other and reads the answers."""

    def __init__(self, machine):
        self.machine = machine
        self.now_us = 20 * MS
        self.reader = codec.FrameReader()
        self.read = 0
        self.heard = []
        self.run(ANSWER_WITHIN_MS)

    def run(self, ms):
        self.now_us += round(ms * MS)
        self.machine.run_to(self.now_us)
        said = self.machine.sent[self.read :]
        self.read += len(said)
        for frame in self.reader.feed(bytes(byte for _, byte in said)):
            self.heard.append(codec.decode_answer(frame))
        return self

    def send(self, data):
        self.machine.give(self.now_us, data)
        count = len(self.heard)
        self.run(ANSWER_WITHIN_MS)
        return self.heard[count:]

    def ask(self, data):
        return next(a for a in self.send(data) if not isinstance(a, codec.BandEvent))

    def events(self):
        return [answer.code for answer in self.heard if isinstance(answer, codec.BandEvent)]

    def arm(self):
        assert self.ask(codec.encode_arm(1, True)).status == codec.OK
        return self

    @property
    def duties(self):
        return self.machine.duties


@pytest.fixture
def host(machine):
    return Host(machine)


def change_after(host, t_us, *, running):
    """Return the machine time at which the motors came to run, or fell silent, after `t_us`."""
    return next(c.t_us for c in host.machine.changes if c.t_us >= t_us and any(c.duties) == running)


def test_boots_silent_disarmed_and_says_so(host):
    assert host.duties == OFF
    assert host.events() == [1]
    refused = host.ask(codec.encode_set(1, 500, FULL))
    assert (codec.NOT_ARMED, OFF) == (refused.status, refused.duties)
    assert host.duties == OFF


def test_hello_tells_version_motors_and_range(host):
    welcome = host.ask(codec.encode_hello(7))

    assert (7, 1, 4, (115, 255), (57.0, 126.0)) == (
        welcome.seq,
        welcome.version,
        welcome.motor_count,
        welcome.duty_range,
        welcome.rate_range_hz,
    )


def test_amplitude_runs_through_the_duty_range_and_never_outside(host):
    host.arm()
    ack = host.ask(codec.encode_set(2, 500, (1, 128, 255, 0)))

    assert (codec.OK, (116, 185, 255, 0)) == (ack.status, ack.duties)
    assert host.duties == (116, 185, 255, 0)


def test_rates_are_held_to_the_pilot_tested_range(host):
    host.arm()
    ack = host.ask(codec.encode_set(2, 500, FULL, (1, 57, 126, 255)))

    assert (115, 115, 255, 255) == ack.duties


def test_every_rate_gives_its_duty(host):
    host.arm()
    for seq, hz in enumerate(range(57, 127, 3), start=2):
        ack = host.ask(codec.encode_set(seq, 500, FULL, (hz,) * 4))
        assert ack.duties[0] == pytest.approx(115 + (hz - 57) * 140 / 69, abs=0.51)


def test_time_to_live_ends_a_setting(host):
    host.arm()
    start_us = host.now_us
    host.send(codec.encode_set(2, 120, FULL))
    host.run(150)

    on_us = change_after(host, start_us, running=True)
    assert change_after(host, on_us, running=False) - on_us == pytest.approx(120 * MS, abs=2 * MS)
    assert 3 in host.events()


def test_dead_man_silences_a_quarter_second_after_the_last_frame(host):
    host.arm()
    start_us = host.now_us
    host.send(codec.encode_set(2, 10_000, FULL))
    host.run(300)

    on_us = change_after(host, start_us, running=True)
    assert change_after(host, on_us, running=False) - on_us == pytest.approx(250 * MS, abs=2 * MS)
    assert 2 in host.events()


def test_damaged_frames_do_not_feed_the_dead_man(host):
    host.arm()
    host.send(codec.encode_set(2, 10_000, FULL))
    broken = bytearray(codec.encode_ping(3, 2))
    broken[5] ^= 1
    for _ in range(15):
        host.send(bytes(broken))
    assert host.duties == OFF


def test_pings_that_agree_keep_it_running_and_one_that_does_not_silences(host):
    host.arm()
    host.send(codec.encode_set(2, 10_000, FULL))
    for seq in range(3, 30):
        assert host.ask(codec.encode_ping(seq, 2)).status == codec.OK
    assert host.duties == FULL
    assert host.ask(codec.encode_ping(40, 1)).status == codec.DISAGREED
    assert host.duties == OFF


def test_ping_that_expects_silence_ends_what_runs(host):
    host.arm()
    host.send(codec.encode_set(2, 10_000, FULL))
    assert host.ask(codec.encode_ping(3, None)).status == codec.DISAGREED
    assert host.duties == OFF


def contact(seq, *, pattern=1, mask=5, duration_ms=1000):
    return codec.encode_pattern(
        seq, pattern, mask, 255, 57, 126, modulation_dhz=100, duration_ms=duration_ms
    )


def run_pattern(host, ms, seq=2):
    for _ in range(0, ms, 60):
        host.send(codec.encode_ping(100, seq))
        host.run(40)


def test_sine_swings_at_ten_hertz_through_the_range_and_ends_by_itself(host):
    host.arm()
    start_us = host.now_us
    host.send(contact(2))
    run_pattern(host, 1100)

    stamps = np.array([c.t_us for c in host.machine.changes if c.t_us >= start_us])
    duties = np.array([c.duties for c in host.machine.changes if c.t_us >= start_us])
    assert (duties[:, [1, 3]] == 0).all()
    on = duties[:, 0] > 0
    assert (115, 255) == (duties[on, 0].min(), duties[on, 0].max())
    rising = np.flatnonzero((duties[:-1, 0] < 180) & (duties[1:, 0] >= 180) & on[:-1])
    np.testing.assert_allclose(np.diff(stamps[rising + 1]), 100 * MS, atol=3 * MS)
    on_us = change_after(host, start_us, running=True)
    assert change_after(host, on_us, running=False) - on_us == pytest.approx(1e6, abs=2 * MS)
    assert 8 in host.events()


def test_square_is_off_half_of_the_time(host):
    host.arm()
    host.send(contact(2, pattern=2, mask=1))
    run_pattern(host, 1100)

    changes = [c for c in host.machine.changes if c.t_us >= 60 * MS]
    on_us = sum(b.t_us - a.t_us for a, b in itertools.pairwise(changes) if a.duties[0])
    assert on_us == pytest.approx(500 * MS, rel=0.03)


def test_ramp_rises_from_slow_to_fast(host):
    host.arm()
    host.send(contact(2, pattern=3, mask=8))
    run_pattern(host, 1100)

    fourth = [c.duties[3] for c in host.machine.changes if any(c.duties)]
    assert fourth == sorted(fourth)
    assert (115, 254) == (fourth[0], pytest.approx(fourth[-1], abs=1))


@pytest.mark.parametrize(
    "wrong",
    [
        contact(2, duration_ms=2001),
        contact(2, duration_ms=0),
        contact(2, pattern=4),
        contact(2, mask=0),
        contact(2, mask=16),
        codec.encode_pattern(2, 1, 1, 255, 56, 126, modulation_dhz=100, duration_ms=100),
        codec.encode_pattern(2, 1, 1, 255, 57, 127, modulation_dhz=100, duration_ms=100),
        codec.encode_set(2, 0, FULL),
        codec.encode_set(2, 10_001, FULL),
    ],
)
def test_commands_outside_the_limits_are_refused(host, wrong):
    host.arm()
    assert host.ask(wrong).status == codec.BAD_ARGUMENT
    assert host.duties == OFF


def test_repeated_sequence_number_is_answered_but_not_done_again(host):
    host.arm()
    first = host.ask(contact(2, duration_ms=50))
    host.run(100)
    again = host.ask(contact(2, duration_ms=50))

    assert first == again
    assert host.duties == OFF


def test_stop_is_done_every_time_it_is_asked(host):
    host.arm()
    host.ask(codec.encode_stop(9))
    host.send(codec.encode_set(2, 1000, FULL))
    assert host.ask(codec.encode_stop(9)).duties == OFF
    assert host.duties == OFF


def test_disarming_and_greeting_silence(host):
    for last_word in (codec.encode_arm(5, False), codec.encode_hello(0)):
        host.arm()
        host.send(codec.encode_set(2, 1000, FULL))
        assert host.duties == FULL
        host.send(last_word)
        assert host.duties == OFF
        assert host.ask(codec.encode_set(3, 1000, FULL)).status == codec.NOT_ARMED


def test_program_that_runs_wild_is_reset_silent_by_the_watchdog(host):
    host.arm()
    host.send(codec.encode_set(2, 10_000, FULL))
    hung_us = host.now_us
    host.machine.hang()
    host.run(400)

    assert change_after(host, hung_us, running=False) - hung_us < 200 * MS
    assert host.events() == [1, 1]
    assert host.ask(codec.encode_set(3, 1000, FULL)).status == codec.NOT_ARMED


def test_battery_is_told_and_an_empty_one_runs_nothing(host):
    host.arm()
    host.run(600)
    answer = host.ask(codec.encode_ping(2, None))
    assert answer.battery_mv == pytest.approx(3900, abs=10)
    host.machine.surround(3450, 25.0)
    host.run(800)
    assert host.events()[-1] == 4
    host.machine.surround(3200, 25.0)
    host.run(800)
    assert host.ask(codec.encode_set(3, 500, FULL)).status == codec.BATTERY_EMPTY
    host.machine.surround(3900, 25.0)
    host.run(800)
    assert host.events()[-1] == 5


def test_heat_silences_and_refuses_until_it_is_cool_again(host):
    host.arm()
    host.run(600)
    host.machine.surround(3900, 65.0)
    host.run(800)
    assert host.events()[-1] == 6
    assert codec.TOO_HOT == host.ask(codec.encode_set(3, 500, FULL)).status
    host.machine.surround(3900, 40.0)
    host.run(800)
    assert host.events()[-1] == 7
    assert codec.OK == host.ask(codec.encode_set(4, 500, FULL)).status


def test_noise_and_cut_frames_never_hide_the_next_command(host):
    host.arm()
    rng = np.random.default_rng(4)
    for seq in range(2, 12):
        host.machine.give(host.now_us, rng.integers(0, 256, 40).astype(np.uint8).tobytes())
        host.run(NOISE_MS)
        assert host.ask(codec.encode_set(seq, 1000, (seq,) * 4)).duties[0] > 0


def test_limits_are_chosen_when_it_is_built(tmp_path):
    try:
        command = build("host", tmp_path, "-DDUTY_MIN=100 -DDUTY_MAX=200 -DRATE_MAX_HZ=107")
    except DeviceNotFound as missing:
        pytest.skip(str(missing))
    with LockstepMachine(command) as machine:
        host = Host(machine)
        welcome = host.ask(codec.encode_hello(0))
        host.arm()
        ack = host.ask(codec.encode_set(2, 500, (1, 255, 255, 255), (0, 0, 82, 126)))

    assert ((100, 200), (57.0, 107.0)) == (welcome.duty_range, welcome.rate_range_hz)
    assert (100, 200, 150, 200) == ack.duties


def test_c_core_survives_damaged_frames_under_address_and_overflow_checks(tmp_path):
    try:
        build("host", tmp_path)
    except DeviceNotFound as missing:
        pytest.skip(str(missing))
    done = subprocess.run(
        [str(tmp_path / "armband_fuzz"), "50000", "11"], capture_output=True, text=True
    )

    assert done.returncode == 0, done.stdout + done.stderr
    found = json.loads(done.stdout)
    assert found["wrong_until_refresh"] > 0
    assert 0 == found["survived"]

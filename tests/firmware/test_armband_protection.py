"""What keeps motors, supply and skin from harm, whatever the host asks: AVR image, C, Python."""

import itertools
import shutil

import pytest

from tests.devices.wire_ends.armband_machine import LockstepMachine, PythonMachine, build
from tests.firmware.test_armband_firmware import FULL, MS, OFF, Host
from visavis.devices.drivers.armband import codec
from visavis.devices.sim.armband.firmware import Protection
from visavis.lab.errors import DeviceNotFound

SHORT = Protection(window_ms=12_000, budget_ms=6000, hold_max_ms=10_000)
"""A tenth of the window, so that a test takes seconds."""
FLAGS = {
    "short": "-DWINDOW_MS=12000 -DBUDGET_MS=6000 -DHOLD_MAX_MS=10000",
    "weak supply": "-DCURRENT_MAX_MA=200",
    "skin": "-DSKIN_SENSOR=1",
}
PROTECTIONS = {
    "short": SHORT,
    "weak supply": Protection(current_max_ma=200),
    "skin": Protection(has_skin_sensor=True),
}


@pytest.fixture(scope="session")
def built_with(tmp_path_factory):
    """Return the command of a machine compiled with these limits."""
    known = {}

    def command(kind, name):
        if (kind, name) not in known:
            folder = tmp_path_factory.mktemp("limited")
            try:
                known[kind, name] = build(kind, folder, FLAGS[name])
            except DeviceNotFound as missing:
                pytest.skip(str(missing))
        return known[kind, name]

    return command


@pytest.fixture(params=["simavr", "host", "python"])
def made_with(request, built_with):
    """Return a host before a machine with these limits."""
    machines = []

    def host(name):
        if request.param == "python":
            machine = PythonMachine(PROTECTIONS[name])
        else:
            machine = LockstepMachine(built_with(request.param, name))
        machines.append(machine)
        if name == "skin":
            machine.surround(3900, 25.0, skin_c=32.0)
        return Host(machine)

    yield host
    for machine in machines:
        machine.close()


@pytest.fixture
def host(machine):
    return Host(machine)


def on_us(changes, motor, until_us):
    """Return the stretches in which a motor was on."""
    ends = [*(change.t_us for change in changes[1:]), until_us]
    return [
        (change.t_us, end)
        for change, end in zip(changes, ends, strict=True)
        if change.duties[motor] and end > change.t_us
    ]


def longest_on_us(changes, motor, window_us, until_us):
    """Return how long a motor was on, at most, in any window of this length."""
    stretches = on_us(changes, motor, until_us)

    def within(start_us):
        return sum(max(0, min(b, start_us + window_us) - max(a, start_us)) for a, b in stretches)

    starts = {a for a, _ in stretches} | {max(0, b - window_us) for _, b in stretches}
    return max(map(within, starts), default=0)


def keep_asking(host, ms, *, settings=(FULL, (254,) * 4), every_ms=200):
    """Ask for vibration as a host gone mad would: always, and changing, so that nothing expires."""
    seqs = itertools.cycle(range(2, 250))
    chosen = itertools.cycle(settings)
    statuses = []
    for _ in range(0, ms, every_ms):
        ack = host.ask(codec.encode_set(next(seqs), 5000, next(chosen)))
        statuses.append(ack.status)
        host.run(every_ms - 20)
    return statuses


def test_no_motor_is_on_for_longer_than_its_budget_in_any_window(made_with):
    host = made_with("short").arm()
    statuses = keep_asking(host, 20_000)

    for motor in range(4):
        longest_us = longest_on_us(host.machine.changes, motor, 12_000 * MS, host.now_us)
        assert 5_900 * MS < longest_us <= 6_002 * MS
    assert codec.RESTING in statuses
    assert {9, 10} <= set(host.events())


def test_motor_that_rests_leaves_the_others_their_time(made_with):
    host = made_with("short").arm()
    keep_asking(host, 7000, settings=((255, 0, 0, 0), (254, 0, 0, 0)))
    ack = host.ask(codec.encode_set(251, 500, FULL))
    host.run(20)

    assert (codec.OK, (0, 255, 255, 255)) == (ack.status, ack.duties)
    assert host.duties == (0, 255, 255, 255)


def test_starting_anew_gives_no_time_back(made_with):
    host = made_with("short").arm()
    statuses = []
    for _ in range(8):
        statuses += keep_asking(host, 1500)
        host.machine.hang()
        host.run(400)
        host.arm()

    longest_us = longest_on_us(host.machine.changes, 0, 12_000 * MS, host.now_us)
    assert 4_000 * MS < longest_us <= 6_002 * MS
    assert codec.RESTING in statuses


def test_refreshes_extend_no_setting_beyond_its_longest(made_with):
    host = made_with("short").arm()
    start_us = host.now_us
    statuses = []
    for seq in range(2, 230):
        statuses.append(host.ask(codec.encode_set(seq, 5000, (255, 0, 0, 0))).status)
        host.run(30)
        if statuses[-1] != codec.OK:
            break

    assert statuses[-1] in (codec.HELD, codec.RESTING)
    assert host.now_us - start_us < 10_100 * MS


def test_setting_that_held_for_long_is_refused_until_it_was_let_go():
    host = Host(PythonMachine(Protection(hold_max_ms=10_000))).arm()
    statuses = keep_asking(host, 12_000, settings=(FULL,))

    assert statuses.index(codec.HELD) == 50
    assert set(statuses[50:]) == {codec.HELD}
    assert host.duties == OFF
    assert 11 in host.events()
    host.ask(codec.encode_stop(250))
    assert host.ask(codec.encode_set(251, 500, FULL)).status == codec.OK


def test_motors_start_one_after_the_other(host):
    host.arm()
    start_us = host.now_us
    host.send(codec.encode_set(2, 500, FULL))
    host.run(50)

    starts_us = [
        next(c.t_us for c in host.machine.changes if c.t_us >= start_us and c.duties[motor])
        for motor in range(4)
    ]
    for first_us, second_us in itertools.pairwise(starts_us):
        assert second_us - first_us == pytest.approx(4 * MS, abs=1.5 * MS)


def test_motors_that_still_turn_need_no_start(host):
    host.arm()
    host.send(codec.encode_set(2, 500, FULL))
    host.run(100)
    host.send(codec.encode_stop(3))
    host.run(20)
    start_us = host.now_us
    host.send(codec.encode_set(4, 500, FULL))

    again = [c for c in host.machine.changes if c.t_us >= start_us]
    assert [FULL] == [c.duties for c in again if any(c.duties)][:1]


def test_supply_that_is_too_high_lowers_the_duty(host):
    host.arm()
    host.machine.surround(4100, 25.0, motor_mv=4100)
    host.run(800)
    ack = host.ask(codec.encode_set(2, 500, (255, 1, 0, 0)))

    highest = 255 * 3600 // 4100
    assert ack.duties == (pytest.approx(highest, abs=1), 116, 0, 0)
    assert host.duties[0] * 4100 / 255 <= 3600 + 4100 / 255


def test_supply_that_is_not_known_counts_as_the_worst(host):
    host.arm()
    host.machine.surround(3900, 25.0, motor_mv=0)
    host.run(800)

    assert host.ask(codec.encode_set(2, 500, FULL)).duties == (255 * 3600 // 4250,) * 4


def test_motors_together_take_no_more_than_the_supply_gives(made_with):
    host = made_with("weak supply").arm()
    host.send(codec.encode_set(2, 1000, FULL))
    host.run(200)

    assert sum(duty * 80 / 255 for duty in host.duties) <= 200
    assert len(set(host.duties)) == 1
    for change in host.machine.changes:
        running_ma = sum(duty * 80 / 255 for duty in change.duties)
        assert running_ma <= 200


def test_skin_at_43_degrees_silences_until_it_has_cooled(made_with):
    host = made_with("skin").arm()
    assert host.ask(codec.encode_hello(1)).capabilities == 3
    host.arm()
    host.send(codec.encode_set(2, 5000, FULL))
    host.machine.surround(3900, 25.0, skin_c=43.6)
    host.run(200)

    assert host.duties == OFF
    assert host.events()[-1] == 6
    refused = host.ask(codec.encode_set(3, 500, FULL))
    assert refused.status == codec.TOO_HOT
    assert refused.temperature_c == pytest.approx(43.6, abs=0.3)
    host.machine.surround(3900, 25.0, skin_c=42.0)
    host.run(400)
    assert host.ask(codec.encode_set(4, 500, FULL)).status == codec.TOO_HOT
    host.machine.surround(3900, 25.0, skin_c=38.0)
    host.run(400)
    assert host.ask(codec.encode_set(5, 500, FULL)).status == codec.OK


@pytest.mark.parametrize("skin_c", [42.5, 36.0, 20.0, 5.0])
def test_skin_temperature_is_told_within_a_third_of_a_degree(made_with, skin_c):
    host = made_with("skin").arm()
    host.machine.surround(3900, 25.0, skin_c=skin_c)
    host.run(400)
    assert host.ask(codec.encode_ping(9, None)).temperature_c == pytest.approx(skin_c, abs=0.33)


def test_nothing_runs_without_the_thermistor_that_it_was_built_for(made_with):
    host = made_with("skin").arm()
    host.send(codec.encode_set(2, 5000, FULL))
    host.machine.surround(3900, 25.0, skin_c=None)
    host.run(200)

    assert host.duties == OFF
    assert host.events()[-1] == 12
    refused = host.ask(codec.encode_set(3, 500, FULL))
    assert (codec.BLIND, None) == (refused.status, refused.temperature_c)


def test_bootloader_that_hands_over_lets_it_come_back_silent(built):
    command = built("simavr")
    folder = command[0].rpartition("/")[0]
    with LockstepMachine([*command, f"{folder}/boot_new.elf"]) as machine:
        host = Host(machine)
        host.run(400)
        host.arm()
        for seq in range(3):
            host.send(codec.encode_set(2 + seq, 5000, FULL))
            assert host.duties == FULL
            host.machine.hang()
            hung_us = host.now_us
            host.run(600)
            off_us = next(c.t_us for c in machine.changes if c.t_us >= hung_us)
            assert off_us - hung_us <= 130 * MS
            assert host.duties == OFF
            assert host.ask(codec.encode_set(9, 500, FULL)).status == codec.NOT_ARMED
            host.arm()
    boots = [answer.value for answer in host.heard if getattr(answer, "code", 0) == 1]
    assert [8, 8, 8] == boots[1:]  # the watchdog, as the bootloader hands it on


def test_bootloader_that_knows_no_watchdog_resets_for_ever_in_silence(built):
    command = built("simavr")
    folder = command[0].rpartition("/")[0]
    with LockstepMachine([*command, f"{folder}/boot_old.elf"]) as machine:
        host = Host(machine)
        host.run(400)
        host.arm()
        host.send(codec.encode_set(2, 5000, FULL))
        hung_us = host.now_us
        host.machine.hang()
        heard = len(host.heard)
        for _ in range(20):
            machine.give(host.now_us, codec.encode_arm(1, True) + codec.encode_set(2, 5000, FULL))
            host.run(100)

    late = [c for c in machine.changes if c.t_us > hung_us + 130 * MS]
    assert not any(any(c.duties) for c in late)
    assert host.duties == OFF
    assert len(host.heard) == heard


@pytest.mark.skipif(shutil.which("avr-gcc") is None, reason="apt-get install gcc-avr avr-libc")
@pytest.mark.parametrize(
    "wrong", ["-DHOLD_MAX_MS=5000", "-DBUDGET_MS=200000", "-DSTAGGER_MS=60", "-DCURRENT_MAX_MA=0"]
)
def test_limits_that_protect_nobody_are_not_compiled(tmp_path, wrong):
    with pytest.raises(Exception, match="make avr failed"):
        build("simavr", tmp_path, wrong)

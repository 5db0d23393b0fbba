"""Armbands that are not our own: what each promises, on its simulator and a virtual clock."""

import math
from contextlib import ExitStack
from itertools import pairwise

import pytest

from tests.devices.band_makers import ascii_armband, hid_armband, vhp_sleeve
from tests.devices.every_driver import own_options
from tests.devices.other_band_rigs import BANDS, RUNS_FOR_EVER, BandRig
from visavis.devices import conformance
from visavis.devices.building import build_device
from visavis.devices.byte_links import MemoryLink
from visavis.devices.contracts import (
    BAND_EVENTS,
    HAPTICS,
    NO_DEVICE_TIME,
    DeviceState,
    VibrationPattern,
)
from visavis.devices.drivers.bands.driver import HOST_SIDE_ONLY, silence_every_open_band
from visavis.devices.registry import OPTION_MODELS, built_in
from visavis.devices.sim.bands.vhp import SleeveSimulator
from visavis.devices.wirelog import ReplayLink, TeeLink
from visavis.lab.clock import NS_PER_MS, SimClock, SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import (
    ConfigError,
    DeviceDisconnected,
    DeviceError,
    DeviceNotFound,
    DeviceTimeout,
    ProtocolViolation,
)

ON = (1.0, 0.5, 0.0, 0.25)
every_band = pytest.mark.parametrize("name", BANDS)


@every_band
def test_band_keeps_the_life_of_a_device_and_the_rules_of_batches(name):
    rig = BandRig(name)
    devices = iter([rig.driver, BandRig(name, clock=rig.clock).driver])

    def let_pass(seconds):
        rig.clock.sleep_until_ns(rig.clock.now_ns() + round(seconds * 1e9))

    conformance.check_lifecycle(lambda: next(devices), let_pass)
    conformance.check_batches(lambda: next(devices), let_pass)


@every_band
@pytest.mark.parametrize("wire", ["memory", "replay"])
def test_band_keeps_the_rules_of_armbands(name, wire, tmp_path):
    rig = BandRig(name)
    path = tmp_path / "séance 1.wire"

    def let_pass(seconds):
        rig.clock.sleep_until_ns(rig.clock.now_ns() + round(seconds * 1e9))

    if wire == "memory":
        conformance.check_armband(lambda: rig.driver, let_pass)
        return
    tees = []

    def wrap(link, clock):
        tees.append(TeeLink(link, path, clock))
        return tees[0]

    rig = BandRig(name, wrap=wrap)
    conformance.check_armband(lambda: rig.driver, let_pass)
    tees[0].end()
    make = BANDS[name][0]
    conformance.check_armband(lambda: make("arm", rig.clock, ReplayLink(path, rig.clock)), let_pass)
    conformance.check_lifecycle(
        lambda: make("arm", rig.clock, ReplayLink(path, rig.clock)), let_pass
    )


@every_band
def test_motors_do_what_was_asked_in_order(name):
    rig = BandRig(name).start()

    rig.driver.set_amplitudes(ON, 1000)
    rig.run(0.05)

    assert rig.levels == pytest.approx(ON, abs=0.011)


@every_band
def test_motors_fall_silent_at_the_end_of_their_time_to_live(name):
    rig = BandRig(name).start()

    rig.driver.set_amplitudes(ON, 300)
    rig.run(0.28)
    assert not rig.is_silent
    rig.run(0.06)

    assert rig.is_silent
    assert BAND_EVENTS.index("expired") in rig.told()["event"]


@every_band
def test_row_tells_command_and_that_nobody_confirmed(name):
    rig = BandRig(name).start()
    rig.run(0.1)
    t_ns = rig.clock.now_ns()

    number = rig.driver.set_amplitudes(ON, 200)
    rig.run(0.1)

    (row,) = rig.rows(0)
    assert (number, t_ns, t_ns) == (row["command"], row["t_commanded_ns"], row["t_sent_ns"])
    assert not row["acknowledged"]
    assert tuple(row["amplitudes_01"]) == ON
    assert row["duration_ms"] == 200
    devices_ns = [t for b in rig.batches for t in b.t_device_ns]
    assert set(devices_ns) == {NO_DEVICE_TIME}
    commands = [b for b in rig.batches if b.schema is HAPTICS]
    stamps = {
        int(c): int(t)
        for b in commands
        for c, t in zip(b.values["command"], b.t_host_ns, strict=True)
    }
    assert stamps[number] == t_ns  # with nothing to wait for, a row is done once it is sent


@every_band
@pytest.mark.parametrize("way_out", ["silence", "stop", "close", "loop stalls", "interpreter ends"])
def test_every_way_out_is_silent(name, way_out):
    rig = BandRig(name).start()
    rig.driver.set_amplitudes(ON, 10_000)
    rig.run(0.1)
    assert not rig.is_silent

    if way_out == "loop stalls":
        rig.run(0.17, alive=False)
        assert "stood still" in rig.messages()
    elif way_out == "interpreter ends":
        silence_every_open_band()
    else:
        getattr(rig.driver, way_out)()

    assert rig.is_silent
    rig.driver.close()


@every_band
def test_lost_silence_is_said_again(name):
    rig = BandRig(name, {"kind": "loss", "start_s": 0.1, "duration_s": 0.02, "amount": 1.0})
    rig.start()
    rig.driver.set_amplitudes(ON, 2000)
    rig.run(0.1)
    rig.clock.sleep_until_ns(110 * NS_PER_MS)

    rig.driver.silence()
    rig.run(0.12)

    assert rig.is_silent


@pytest.mark.parametrize("name", ["vhp_sleeve", "vhp_slim", "ascii", "hid", "usb"])
def test_lost_setting_is_repeated_where_the_band_runs_for_ever(name):
    rig = BandRig(name, {"kind": "loss", "start_s": 0.0, "duration_s": 0.05, "amount": 1.0})
    rig.start()
    rig.driver.set_amplitudes(ON, 2000)
    rig.run(0.2)

    assert rig.is_silent == (name == "vhp_slim")  # a pattern felt twice would be a lie


@every_band
def test_disconnect_is_told_once_and_the_band_comes_back_silent(name):
    rig = BandRig(name, {"kind": "disconnect", "start_s": 1.0, "duration_s": 1.0}).start()
    rig.driver.set_amplitudes(ON, 10_000)
    with pytest.raises(DeviceDisconnected, match="arm"):
        rig.run(1.5)
    assert rig.driver.state is DeviceState.FAULT
    rig.driver.set_amplitudes(ON, 100)
    rig.run(1.5)

    assert rig.driver.state is DeviceState.STREAMING
    assert rig.is_silent
    rig.driver.set_amplitudes(ON, 1000)
    rig.run(0.1)
    assert rig.levels == pytest.approx(ON, abs=0.011)


@every_band
def test_late_band_is_not_found_then_opens(name):
    rig = BandRig(name, {"kind": "late_start", "duration_s": 1.0})

    with pytest.raises(DeviceNotFound, match="arm"):
        rig.driver.open(0.5)
    rig.clock.sleep_until_ns(1_100_000_000)
    rig.driver.open(2.0)

    assert rig.driver.state is DeviceState.OPEN


@pytest.mark.parametrize("name", ["buzz", "bhaptics"])
def test_band_that_takes_the_opening_and_says_nothing_times_out(name):
    rig = BandRig(name, {"kind": "mute"})

    with pytest.raises(DeviceTimeout, match="does not answer"):
        rig.driver.open(2.0)


@every_band
def test_sooner_setting_waits_and_the_newest_wins(name):
    rig = BandRig(name).start()
    rig.run(0.1)
    for k in range(10):
        rig.driver.set_amplitudes((k / 10, 0.0, 0.0, 1.0), 1000)
    rig.run(0.1)

    assert rig.levels == pytest.approx((0.9, 0.0, 0.0, 1.0), abs=0.011)
    sent = rig.rows(0)["t_sent_ns"]
    assert (sent > 0).sum() == 2


@every_band
def test_square_pattern_is_played_from_this_side_and_ends(name):
    rig = BandRig(name).start()

    rig.driver.play(VibrationPattern("square", 1000, modulation_hz=2.0), [0, 3], 0.8)
    seen = []
    for _ in range(10):
        rig.run(0.1)
        seen.append(rig.levels[0] > 0.5)
        assert rig.levels[1:3] == (0.0, 0.0)
    rig.run(0.1)

    assert 4 <= seen.count(True) <= 6
    assert 2 == sum(now and not before for before, now in pairwise([False, *seen]))
    assert rig.is_silent
    (row,) = rig.rows(1)
    assert (2, 1000.0) == (row["pattern"], row["duration_ms"])


@every_band
def test_wrong_commands_are_refused_with_what_may_be(name):
    rig = BandRig(name).start()

    for amplitudes, ttl_ms in (((1.0,), 100), ((2.0, 0, 0, 0), 100), ((math.nan,) * 4, 9), (ON, 0)):
        with pytest.raises(DeviceError, match="arm: "):
            rig.driver.set_amplitudes(amplitudes, ttl_ms)
    with pytest.raises(DeviceError, match="vibrat"):
        rig.driver.set_amplitudes(ON, 100, rates_hz=(5000.0,) * 4)


@every_band
def test_noise_on_the_wire_never_raises_and_ends_in_silence(name):
    rig = BandRig(name, {"kind": "garbage", "start_s": 0.2, "duration_s": 3, "amount": 0.3})
    rig.start()
    for _ in range(30):
        rig.driver.set_amplitudes(ON, 120)
        rig.run(0.1)
    rig.run(1.0)
    rig.driver.silence()
    rig.run(0.2)

    assert rig.is_silent


def test_bands_that_run_for_ever_say_so():
    for name in BANDS:
        driver = BandRig(name).driver
        flagged = HOST_SIDE_ONLY in driver.info.capabilities
        warned = any("goes on vibrating" in fault.message for fault in driver.check())
        assert (flagged, warned) == ((name in RUNS_FOR_EVER),) * 2


def test_buzz_names_itself_and_its_battery():
    rig = BandRig("buzz").start().run(0.2)

    assert ("Buzz (firmware 1.9)", "BZ-0042") == (rig.driver.info.model, rig.driver.info.serial)
    assert rig.driver.health().battery_01 == 0.76


def test_buzz_that_refuses_developers_is_named_with_the_cure():
    rig = BandRig("buzz")
    rig.peer.authorises = False

    with pytest.raises(ProtocolViolation, match=r"auth as developer.*phone app"):
        rig.driver.open(2.0)


def test_low_battery_is_told():
    rig = BandRig("ascii")
    rig.peer.battery_percent = 12
    rig.start().run(0.2)

    assert "battery low (12%)" in rig.messages()


def test_refusal_of_a_text_band_is_told():
    rig = BandRig("ascii").start()
    rig.peer.accept(b"nonsense\n", rig.clock.now_ns())
    rig.run(0.1)

    assert "said '? nonsense'" in rig.messages()


def test_slim_board_tells_battery_and_temperature():
    rig = BandRig("vhp_slim").start().run(3.0)

    last = rig.told()[-1]
    assert last["battery_01"] == pytest.approx((3900 - 3300) / 850, abs=0.01)
    assert last["electronics_temperature_c"] == 31.5


def test_slim_board_plays_the_rate_that_was_asked():
    rig = BandRig("vhp_slim").start()

    rig.driver.set_amplitudes((1.0, 1.0, 0.0, 1.0), 500, rates_hz=(60.0, 110.0, 60.0, 126.0))
    rig.run(0.05)

    assert [rig.peer.tones_hz[i] for i in (0, 2, 4, 8)] == [60.0, 100.0, 0.0, 125.0]


def test_sleeve_buffer_holds_zeros_whenever_amplifiers_go_on():
    rig = BandRig("vhp_sleeve")
    rig.peer._samples = bytes(range(96))

    rig.start().run(0.05)

    assert rig.peer.amplifiers_on
    assert [] == rig.peer.log


@pytest.mark.parametrize(("board", "recipient"), [("sleeve", 3), ("slim", 4)])
def test_every_message_names_the_board_that_the_lab_configured(board, recipient):
    messages = []

    class RecordingLink(MemoryLink):
        def write(self, data):
            messages.append(data)
            return super().write(data)

    clock = SimClock()
    band = vhp_sleeve(
        "arm", clock, link=RecordingLink(SleeveSimulator("arm", clock), clock), board=board
    )
    band.open(2.0)
    band.start(lambda batch: None)
    band.set_amplitudes(ON, 200)
    band.close()

    assert len(messages) > 3
    assert {recipient} == {data[1] for data in messages}


def test_sleeve_keeps_vibrating_when_the_host_dies():
    rig = BandRig("vhp_sleeve").start()
    rig.driver.set_amplitudes(ON, 200)
    rig.run(0.1)
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 60_000_000_000)

    assert not rig.is_silent  # which is why `check` warns and every way out sends zeros


def test_bhaptics_unit_ends_by_itself_when_the_host_dies():
    rig = BandRig("bhaptics").start()
    rig.driver.set_amplitudes(ON, 5000)
    rig.run(1.0)
    assert not rig.is_silent
    rig.clock.sleep_until_ns(rig.clock.now_ns() + 110_000_000)

    assert rig.is_silent


def test_unit_missing_from_the_player_blocks():
    rig = BandRig("bhaptics")
    rig.peer.is_unit_on = False
    rig.start().run(0.1)

    (fault,) = (f for f in rig.driver.check() if f.severity == "blocking")
    assert "does not see the band" in fault.message


def test_usb_band_tells_its_battery():
    rig = BandRig("hid").start()
    rig.peer.tell_battery(64, rig.clock.now_ns())
    rig.run(0.1)

    assert rig.driver.health().battery_01 == 0.64


@pytest.mark.parametrize(
    ("commands", "says"),
    [
        ({"set_one": "M{motr}{amplitude}\n"}, r"unknown field \{motr\}"),
        ({}, "either set_one or set_all"),
        ({"set_all": "{a0},{a1}\n"}, r"needs \{a0\} \{a1\} \{a2\} \{a3\}"),
        ({"set_one": "M{motor}{amplitude}", "battery_answer": "("}, "not a regular expression"),
        ({"set_one": "M{motor", "stop": "S"}, "not a template"),
        ({"sett": "x"}, "sett"),
    ],
)
def test_wrong_template_is_a_configuration_error(commands, says):
    with pytest.raises(ConfigError, match=says):
        ascii_armband("arm", SimClock(), commands=commands, port="COM4")


def test_layout_that_does_not_fit_is_a_configuration_error():
    with pytest.raises(ConfigError, match="overrun the report"):
        hid_armband("arm", SimClock(), vid=1, pid=2, layout={"report_bytes": 3})


@pytest.mark.parametrize("ends", ["time to live", "loop stalls"])
def test_motors_stop_on_a_real_clock_though_nobody_polls(ends):
    clock = SystemClock()
    rig = BandRig("ascii", clock=clock, latency_ms=0).start()
    rig.driver.set_amplitudes(ON, 100 if ends == "time to live" else 10_000)
    rig.peer.advance(clock.now_ns())
    assert any(rig.peer.levels_01)

    give_up_ns = clock.now_ns() + 10_000 * NS_PER_MS
    while any(rig.peer.levels_01) and clock.now_ns() < give_up_ns:
        clock.sleep_until_ns(clock.now_ns() + 5 * NS_PER_MS)
        rig.peer.advance(clock.now_ns())

    assert not any(rig.peer.levels_01)
    if ends == "loop stalls":  # a busy machine may stall the other one, too
        assert "stood still" in rig.messages()
    rig.driver.close()


class FeelingBody:
    """A body that writes down what it feels."""

    def __init__(self):
        self.felt = []

    def stretch(self):
        return 0

    def feel(self, role, amplitudes_01, t_ns):
        self.felt.append((role, [round(a, 2) for a in amplitudes_01]))


BAND_DRIVERS = sorted(name for name, spec in built_in().items() if spec.kind == "armband")


@pytest.mark.parametrize("driver", BAND_DRIVERS)
def test_simulated_body_feels_our_motors_in_our_order(driver):
    clock, body = SimClock(), FeelingBody()
    config = DeviceConfig(role="arm", driver=driver, simulated=True, options=own_options(driver))
    band = build_device(config, clock, body, 0, ExitStack())
    band.open(5.0)
    band.start(lambda batch: None)

    band.set_amplitudes((1.0, 0.5, 0.0, 0.0), 5000)
    for _ in range(40):
        clock.sleep_until_ns(clock.now_ns() + 10 * NS_PER_MS)
        band.keep_alive()
        band.poll(0.0)

    role, (first, second, third, fourth) = body.felt[-1]
    assert (role, third, fourth) == ("arm", 0.0, 0.0)
    assert first > second > 0.0
    band.close()


@pytest.mark.parametrize(
    ("driver", "options", "says"),
    [
        ("ascii_armband", {"commands": {}}, "either set_one or set_all"),
        ("bhaptics", {"points": [0, 0]}, "different numbers from 0 to 5"),
        ("ble_armband", {}, "address or the name"),
        ("spp_armband", {"port": "COM4", "address": "AA:BB:CC:DD:EE:FF"}, "either port"),
        ("vhp_slim", {"channels": [12]}, "from 0 to 11"),
        ("hid_armband", {"vid": 1, "pid": 2, "layout": {"prefix": "a5f"}}, "prefix"),
    ],
)
def test_wrong_options_say_what_may_be(driver, options, says):
    with pytest.raises(ValueError, match=says):
        OPTION_MODELS[driver].model_validate(options)

"""What is pressed arrives once, under the name studies ask for, with the time it was pressed at."""

import contextlib
import importlib
import struct
import sys
import types

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.devices.bodies import FixatingBody
from visavis.devices import conformance
from visavis.devices.building import build_device
from visavis.devices.contracts import NO_DEVICE_TIME
from visavis.devices.drivers.buttons.device import Press
from visavis.devices.drivers.buttons.hid import HidButtonLink
from visavis.devices.drivers.buttons.hid_reports import HAT_SIDES, ReportReader, layout_of
from visavis.devices.drivers.buttons.keyboard import KeyLink
from visavis.devices.drivers.buttons.spec import KEYS
from visavis.devices.drivers.buttons.xid import XidReader
from visavis.devices.registry import OPTION_MODELS, driver_wiring
from visavis.devices.sim.buttons.boxes import DESCRIPTOR
from visavis.lab.clock import NEVER_NS, NS_PER_S, SimClock, SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceDisconnected

MS = 1_000_000


def passer(clock):
    return lambda seconds: clock.sleep_until_ns(clock.now_ns() + round(seconds * NS_PER_S))


def simulated(driver, clock, presses, stack, **options):
    checked = OPTION_MODELS[driver].model_validate(options).model_dump()
    config = DeviceConfig(role="responses", driver=driver, simulated=True, options=checked)
    return build_device(config, clock, FixatingBody(presses=presses), 1, stack)


def told(device, clock, seconds=1.0):
    """What arrived: (ms of arrival, control, value)."""
    batches = conformance.collect(device, passer(clock), seconds=seconds)
    return [
        (int(t) // MS, device.controls[row["control"]], float(row["value_01"]))
        for batch in batches
        for t, row in zip(batch.t_host_ns, batch.values, strict=True)
    ]


def window_keyboard(clock, **options):
    link = KeyLink(clock)
    return driver_wiring("keyboard").on_wire("responses", clock, link, **options)


def test_space_is_the_trigger_and_every_key_is_a_control_of_its_own():
    keyboard = window_keyboard(SimClock())
    assert "trigger" in keyboard.controls
    assert "space" not in keyboard.controls
    assert {"f", "j", "left", "1"} <= set(keyboard.controls)


def test_a_key_bears_the_time_at_which_the_window_heard_it_not_that_of_the_frame():
    clock = SimClock()
    keyboard = window_keyboard(clock)
    batches = []
    keyboard.open(1.0)
    keyboard.start(batches.append)
    clock.sleep_until_ns(7 * MS)
    keyboard.hear("f", True)
    clock.sleep_until_ns(9 * MS)
    keyboard.hear("f", False)
    clock.sleep_until_ns(16 * MS)
    assert keyboard.poll(0.0) == 2
    assert [int(t) for b in batches for t in b.t_host_ns] == [7 * MS, 9 * MS]
    assert {int(t) for b in batches for t in b.t_device_ns} == {NO_DEVICE_TIME}
    assert [float(v) for b in batches for v in b.values["value_01"]] == [1.0, 0.0]


def test_a_key_nobody_knows_is_told_and_left_out():
    clock = SimClock()
    keyboard = window_keyboard(clock)
    keyboard.open(1.0)
    keyboard.start(lambda batch: None)
    keyboard.hear("key 94", True)
    assert keyboard.poll(0.0) == 0
    assert "key 94" in keyboard.check()[0].message


def test_keys_are_called_as_the_lab_says():
    keyboard = window_keyboard(SimClock(), keys={"f": "same", "j": "different"})
    assert {"same", "different", "space"} <= set(keyboard.controls)
    with pytest.raises(ConfigError, match="enterr"):
        window_keyboard(SimClock(), keys={"enterr": "trigger"})


def test_what_was_pressed_before_the_session_counts_for_nothing():
    clock = SimClock()
    keyboard = window_keyboard(clock)
    keyboard.open(1.0)
    keyboard.hear("f", True)
    clock.sleep_until_ns(MS)
    keyboard.start(lambda batch: None)
    assert keyboard.poll(0.0) == 0


@given(st.lists(st.tuples(st.sampled_from(KEYS), st.booleans()), max_size=12), st.data())
def test_lines_may_be_cut_anywhere(pressed, data):
    clock = SimClock()
    whole = b"".join((b"+" if down else b"-") + key.encode() + b"\n" for key, down in pressed)
    keyboard = window_keyboard(clock)
    cut = data.draw(st.integers(0, len(whole)))
    found = [*keyboard._read(whole[:cut]), *keyboard._read(whole[cut:])]
    assert [(p.button, p.value_01) for p in found] == [(k, float(d)) for k, d in pressed]
    assert keyboard.unreadable_count == 0


@given(st.binary(max_size=200))
def test_noise_on_the_wire_is_counted_and_raises_nothing(noise):
    keyboard = window_keyboard(SimClock())
    tuple(keyboard._read(noise))
    assert keyboard.unreadable_count >= 0


class ForeseeingHand(FixatingBody):
    def next_press_ns(self):
        return self._presses[0][0] if self._presses else None


def test_simulated_keys_need_not_be_asked_before_the_next_press_or_its_arrival():
    clock, due_ms = SimClock(), []
    hand = ForeseeingHand(presses=[(100 * MS, "trigger", 1.0), (180 * MS, "trigger", 0.0)])
    config = DeviceConfig(role="responses", driver="keyboard", simulated=True, options={})
    with contextlib.ExitStack() as stack:
        device = build_device(config, clock, hand, 1, stack)
        batches = []
        device.open(1.0)
        device.start(batches.append)
        while (due_ns := device.due_ns()) < NEVER_NS:
            due_ms.append(due_ns // MS)
            clock.sleep_until_ns(due_ns)
            device.poll(0.0)
    assert [100, 101, 180, 181] == due_ms
    assert [101, 181] == [int(t) // MS for batch in batches for t in batch.t_host_ns]


def test_keys_of_a_hand_that_does_not_foresee_are_asked_each_time():
    clock = SimClock()
    with contextlib.ExitStack() as stack:
        device = simulated("keyboard", clock, [(100 * MS, "trigger", 1.0)], stack)
        device.open(1.0)
        device.start(lambda batch: None)
        assert clock.now_ns() == device.due_ns()


def test_simulated_presses_arrive_through_the_keyboards_own_wire():
    clock = SimClock()
    presses = [(100 * MS, "trigger", 1.0), (180 * MS, "trigger", 0.0), (300 * MS, "f", 1.0)]
    with contextlib.ExitStack() as stack:
        device = simulated("keyboard", clock, presses, stack)
        assert told(device, clock) == [
            (101, "trigger", 1.0),
            (181, "trigger", 0.0),
            (301, "f", 1.0),
        ]
        assert np.all(device.health().received == 3)


def vendor_reads(data):
    """What Cedrus' own client makes of a pad's bytes: (key, pressed, ms)."""
    sys.modules.setdefault("ftd2xx", types.ModuleType("ftd2xx"))  # its USB library, of no use here
    client = pytest.importorskip("pyxid2.internal", reason="pip install pyxid2")
    connection = client.XidConnection(0, 115_200)
    connection._XidConnection__response_buffer = data
    connection.xid_input_found()
    found = []
    while (one := connection.get_current_response())["key"]:
        found.append((one["port"], one["key"], one["pressed"], one["time"]))
    return found


pad_presses = st.lists(
    st.tuples(st.integers(0, 3), st.integers(1, 8), st.booleans(), st.integers(0, 2**32 - 1)),
    max_size=20,
)


def packets(presses):
    return b"".join(
        struct.pack("<cBI", b"k", (key % 8) << 5 | down << 4 | port, ms)
        for port, key, down, ms in presses
    )


@given(pad_presses)
def test_presses_of_a_cedrus_pad_read_as_the_vendors_client_reads_them(presses):
    data = packets(presses)
    assert vendor_reads(data) == presses
    found = XidReader().feed(data)
    expected = [
        (f"{key}" if port == 0 else f"port{port}_{key}", float(down), ms * MS)
        for port, key, down, ms in presses
    ]
    assert [tuple(press) for press in found] == expected


@given(pad_presses, st.data())
def test_a_pads_bytes_may_be_cut_anywhere(presses, data):
    whole = packets(presses)
    cut = data.draw(st.integers(0, len(whole)))
    reader = XidReader()
    assert reader.feed(whole[:cut]) + reader.feed(whole[cut:]) == XidReader().feed(whole)
    assert reader.unreadable_count == 0


@given(st.binary(max_size=60))
def test_noise_of_a_pad_raises_nothing_and_later_presses_are_found_again(noise):
    reader = XidReader()
    reader.feed(noise)
    resting = reader.feed(b"\x00" * 8 + packets([(0, 3, True, 7)]))
    assert resting[-1] == Press("3", 1.0, 7 * MS)


@pytest.mark.parametrize(
    ("driver", "told_ms"), [("xid_buttons", [90_100, 90_180]), ("byte_buttons", None)]
)
def test_a_simulated_box_is_pressed_through_its_own_wire(driver, told_ms):
    clock = SimClock()
    presses = [(100 * MS, "trigger", 1.0), (180 * MS, "trigger", 0.0)]
    with contextlib.ExitStack() as stack:
        device = simulated(driver, clock, presses, stack)
        batches = conformance.collect(device, passer(clock), seconds=0.5)
    own = [int(t) for b in batches for t in b.t_device_ns]
    if told_ms is None:
        assert own == [NO_DEVICE_TIME]  # it tells presses alone
    else:
        assert [t // MS for t in own] == told_ms


def test_a_box_on_a_serial_port_is_read_through_a_real_terminal():
    os = pytest.importorskip("pty") and importlib.import_module("os")
    tty = pytest.importorskip("tty")
    pytest.importorskip("serial", reason="pip install 'visavis[serial]'")
    clock = SystemClock()
    ours, theirs = os.openpty()
    tty.setraw(ours)
    device = driver_wiring("byte_buttons").on_wire(
        "responses", clock, port=os.ttyname(theirs), keys={"2": "right"}
    )
    batches = []
    device.open(1.0)
    try:
        device.start(batches.append)
        os.write(ours, b"2\r\n9")
        count = 0
        while not count:
            count = device.poll(0.1)
        device.poll(0.05)
    finally:
        device.close()
        os.close(ours)
        os.close(theirs)
    assert [device.controls[b.values["control"][0]] for b in batches] == ["right"]
    assert device.unreadable_count == 1


def gamepad(presses, clock, stack, **options):
    return simulated("hid_buttons", clock, presses, stack, **options)


def test_a_gamepad_names_its_buttons_itself():
    layout = layout_of(DESCRIPTOR)
    buttons = [f"button_{n}" for n in range(1, 11)]
    assert list(layout.buttons()) == [*buttons, *HAT_SIDES, "x-", "x+", "y-", "y+"]
    assert not layout.is_numbered


def test_buttons_direction_pad_and_stick_arrive_under_their_names():
    clock = SimClock()
    presses = [
        (100 * MS, "trigger", 1.0), (150 * MS, "trigger", 0.0), (200 * MS, "left", 1.0),
        (250 * MS, "left", 0.0), (300 * MS, "x+", 1.0), (350 * MS, "x+", 0.0),
        (400 * MS, "button_10", 1.0),
    ]  # fmt: skip
    with contextlib.ExitStack() as stack:
        found = told(gamepad(presses, clock, stack), clock)
    assert [(name, round(value)) for _, name, value in found] == [
        ("trigger", 1), ("trigger", 0), ("left", 1), ("left", 0), ("x+", 1), ("x+", 0),
        ("button_10", 1),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("hat", "down"),
    [
        (0, {"up"}),
        (1, {"up", "right"}),
        (4, {"down"}),
        (7, {"left", "up"}),
        (8, set()),
        (15, set()),
    ],
)
def test_a_hat_switch_between_two_sides_presses_both(hat, down):
    reader = ReportReader(layout_of(DESCRIPTOR))
    found = reader.feed(bytes((0, 0, hat, 0x80, 0x80)))
    assert {p.button for p in found if p.value_01 == 1.0} == down


NUMBERED = bytes.fromhex(
    "05010904a1018501050919012903150025017501950381027505950181031581257f0501093175089501"
    "8102850209301581257f750895018102c0"
)
"""Two reports: 1 holds three buttons and a signed y, 2 a signed x."""


def test_numbered_reports_and_signed_axes_are_kept_apart():
    layout = layout_of(NUMBERED)
    assert layout.is_numbered
    reader = ReportReader(layout)
    first = reader.feed(bytes((1, 0b101, 0x81)))
    assert [(p.button, p.value_01) for p in first] == [
        ("button_1", 1.0),
        ("button_3", 1.0),
        ("y-", 1.0),
    ]
    assert [(p.button, p.value_01) for p in reader.feed(bytes((2, 0x7F)))] == [("x+", 1.0)]


@given(st.binary(max_size=120), st.binary(max_size=16))
def test_nonsense_of_a_hid_raises_nothing(descriptor, report):
    ReportReader(layout_of(descriptor)).feed(report)
    ReportReader(layout_of(DESCRIPTOR + descriptor)).feed(report)


def test_values_of_no_bits_are_none_however_many_are_described():
    count = bytes.fromhex("97ffffffff")  # 4,294,967,295 of them
    described = bytes.fromhex("05091901290a") + count + bytes.fromhex("7500150025018102")
    assert layout_of(described).controls == ()
    assert ReportReader(layout_of(DESCRIPTOR + described)).feed(bytes(5)) is not None


def test_a_short_report_is_counted():
    reader = ReportReader(layout_of(DESCRIPTOR))
    reader.feed(b"\x01")
    assert reader.unreadable_count == 1


class Hidapi:
    """A stand-in for hidapi with one gamepad and one mouse."""

    def __init__(self, *reports):
        self.reports = list(reports)

    def enumerate(self):
        mouse = {"path": b"m", "vendor_id": 1, "product_id": 2, "usage_page": 1, "usage": 2}
        return [mouse, {**mouse, "path": b"g", "vendor_id": 0x045E, "usage": 5}]

    def device(self):
        return self

    def open_path(self, path):
        assert path == b"g"

    def get_report_descriptor(self):
        return list(DESCRIPTOR)

    def read(self, size, wait_ms):
        report = self.reports.pop(0) if self.reports else None
        if report is OSError:
            raise OSError("unplugged")
        return report or []

    def close(self):
        pass


def test_the_first_gamepad_is_taken_and_its_unplugging_told():
    clock = SimClock()
    hidapi = Hidapi(None, [1, 0, 8, 0x80, 0x80], OSError, OSError)
    device = driver_wiring("hid_buttons").on_wire(
        "responses", clock, HidButtonLink(clock, library=hidapi)
    )
    device.open(1.0)
    batches = []
    device.start(batches.append)
    assert device.poll(0.0) == 1
    assert device.controls[batches[0].values["control"][0]] == "trigger"
    assert device.info.transport == "hid 045e:0002"
    with pytest.raises(DeviceDisconnected) as gone:
        device.poll(0.0)
    assert str(gone.value).count("plug it in") == 1

"""Marks become codes on lines: the vendors' own code is the oracle, pulses follow one another."""

import json
import os
import struct
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.faults.sessions import lab, perform
from visavis.devices.byte_links import MemoryLink
from visavis.devices.drivers.links.serial_port import SerialLink
from visavis.devices.drivers.triggers import labjack_codec, xid_commands
from visavis.devices.drivers.triggers.links import ParallelLink
from visavis.devices.drivers.triggers.pulses import PulseTrain
from visavis.devices.faults import FaultSchedule
from visavis.devices.pump import Pump
from visavis.devices.registry import driver_spec, driver_wiring
from visavis.devices.sim.triggers import LabJackPeer, LinesPeer, XidLinesPeer
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock, SystemClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceTimeout

ROOT = Path(__file__).parents[2]
CODES = {"trial_start": 1, "trial_end": 2, "flash": 255}


TIMED = [
    ("serial_triggers", LinesPeer),
    ("labjack_triggers", LabJackPeer),
    ("xid_triggers", XidLinesPeer),
]


def on_lines(faults=(), driver="serial_triggers", peer=LinesPeer, **options):
    clock = SimClock()
    lines = peer("triggers", clock, faults=FaultSchedule.from_config(faults))
    wiring = driver_wiring(driver)
    device = wiring.on_wire("triggers", clock, MemoryLink(lines, clock), codes=CODES, **options)
    batches = []
    device.open(1.0)
    pump = Pump(device, batches.append, clock)
    pump.start()
    return clock, lines, device, pump, batches


def go_on(clock, pump, ms):
    for _ in range(round(ms)):
        clock.sleep_until_ns(clock.now_ns() + NS_PER_MS)
        pump.step()


def rows_of(batches):
    return np.concatenate([batch.values for batch in batches])


def stamps_of(batches):
    return np.concatenate([batch.t_host_ns for batch in batches]).tolist()


@pytest.mark.parametrize(("driver", "peer"), TIMED)
def test_a_code_stands_for_its_width_and_the_next_waits_for_the_rest(driver, peer):
    clock, lines, device, pump, batches = on_lines(driver=driver, peer=peer)
    begin_ns = clock.now_ns()
    for mark in ("trial_start", "flash", "unknown"):
        device.trigger(mark, begin_ns)
    go_on(clock, pump, 40)

    since = [(round((t - begin_ns) / NS_PER_MS), code) for t, code in lines.log]
    assert since[-4:] == [(0, 1), (5, 0), (7, 255), (12, 0)]
    rows = rows_of(batches)
    assert rows["code"].tolist() == [1, 255]
    assert (rows["t_released_ns"] - rows["t_after_ns"]).tolist() == [5 * NS_PER_MS] * 2
    assert rows["t_commanded_ns"].tolist() == [begin_ns] * 2


@pytest.mark.parametrize(("driver", "peer"), TIMED)
def test_a_pulse_bears_the_time_of_its_onset_not_of_its_release(driver, peer):
    clock, _, device, pump, batches = on_lines(driver=driver, peer=peer)
    go_on(clock, pump, 10)
    begin_ns = clock.now_ns()
    for mark in ("trial_start", "flash"):
        device.trigger(mark, begin_ns)
    go_on(clock, pump, 40)

    # each code stands 5 ms and the lines rest 2 ms before the next
    assert stamps_of(batches) == [begin_ns, begin_ns + 7 * NS_PER_MS]


def test_a_pulse_that_the_end_of_a_session_cuts_short_bears_the_time_of_its_onset():
    clock, _, device, pump, batches = on_lines()
    go_on(clock, pump, 10)
    begin_ns = clock.now_ns()
    device.trigger("flash", begin_ns)
    clock.sleep_until_ns(begin_ns + 3 * NS_PER_MS)
    pump.stop()
    assert stamps_of(batches) == [begin_ns]
    assert rows_of(batches)["t_released_ns"].tolist() == [begin_ns + 3 * NS_PER_MS]


def test_lines_are_low_when_a_session_ends_in_the_middle_of_a_pulse():
    _, lines, device, pump, batches = on_lines()
    device.trigger("flash", 0)
    assert lines.log[-1][1] == 255
    pump.stop()
    device.close()
    assert lines.log[-1][1] == 0
    assert (rows_of(batches)["t_released_ns"] >= 0).tolist() == [True]


def test_marks_while_the_box_is_gone_are_rows_without_times_and_are_told():
    away = [{"kind": "disconnect", "start_s": 0.1, "duration_s": 1.0}]
    clock, _, device, pump, batches = on_lines(away)
    go_on(clock, pump, 200)
    device.trigger("trial_start", clock.now_ns())
    go_on(clock, pump, 3000)
    device.trigger("trial_end", clock.now_ns())
    go_on(clock, pump, 20)

    rows = rows_of(batches)
    assert rows["code"].tolist() == [1, 2]
    assert (rows["t_after_ns"] > 0).tolist() == [False, True]
    assert [fault.message for fault in device.check()] == ["1 marks never reached the lines"]


def test_a_labjack_that_does_not_answer_is_told_when_it_is_opened():
    with pytest.raises(DeviceTimeout, match="does not answer"):
        on_lines([{"kind": "mute"}], "labjack_triggers", LabJackPeer)


@pytest.mark.parametrize("number", range(len(labjack_codec.lines_out())))
def test_a_labjack_does_nothing_that_a_packet_with_a_damaged_byte_says(number):
    packet = bytearray(labjack_codec.lines_out())
    packet[number] ^= 0x10
    box = LabJackPeer("triggers", SimClock())
    box.receive(bytes(packet), 0)
    assert (box.directions, box.answers[0].data) == (0, b"\xb8\xb8")
    box.receive(labjack_codec.lines_out(), 0)
    assert box.directions == 0xFF


@pytest.mark.parametrize("code", [0, 256, -1])
def test_codes_that_eight_lines_cannot_hold_are_refused(code):
    with pytest.raises(ConfigError, match=f"{code} is not a code: eight lines hold 1 to 255"):
        driver_spec("serial_triggers").checked_options("triggers", {"codes": {"flash": code}})


@given(
    st.lists(st.tuples(st.integers(0, 30), st.integers(1, 255)), max_size=20),
    st.integers(1, 10),
    st.integers(0, 10),
)
@settings(max_examples=100, deadline=None)
def test_every_code_stands_once_in_order_never_shorter_than_asked(asked, width_ms, settle_ms):
    train = PulseTrain(width_ms, settle_ms)
    written, t_ns = [], 0
    for wait_ms, code in [*asked, (1000, 7)]:
        for _ in range(wait_ms):
            t_ns += NS_PER_MS
            while (step := train.step(t_ns)) is not None:
                written.append((t_ns, step.pulse.code if step.begins else 0))
                train.note_written(step, t_ns)
        train.ask(code, t_ns)
    ups, downs = written[::2], written[1::2]
    assert [code for _, code in ups] == [code for _, code in asked]
    assert all(code == 0 for _, code in downs)
    assert all(d[0] - u[0] == width_ms * NS_PER_MS for u, d in zip(ups, downs, strict=True))
    rests = [u[0] - d[0] for d, u in zip(downs, ups[1:], strict=False)]
    assert all(rest >= settle_ms * NS_PER_MS for rest in rests)


# ---- the vendors' own code ------------------------------------------------------------------


def cedrus_writes(monkeypatch, use):
    """What Cedrus' own client writes to a unit's port."""
    sys.modules.setdefault("ftd2xx", types.ModuleType("ftd2xx"))  # its USB library, of no use here
    client = pytest.importorskip("pyxid2.internal", reason="pip install pyxid2")
    written = []
    connection = client.XidConnection(0, 115_200)
    monkeypatch.setattr(
        connection, "write", lambda data: written.append(data.encode("latin-1")), raising=False
    )
    use(connection)
    return written[-1]


@pytest.mark.parametrize("code", [0, 1, 128, 255, 65_535])
def test_lines_are_raised_as_the_vendors_client_raises_them(monkeypatch, code):
    theirs = cedrus_writes(monkeypatch, lambda unit: unit.set_digital_output_lines(code))

    assert xid_commands.raise_lines(code) == theirs


def test_width_of_a_pulse_is_packed_as_in_the_vendors_client():
    assert xid_commands.pulse_width(5) == struct.pack("<ccI", b"m", b"p", 5)  # set_pulse_duration


def test_unit_is_told_the_width_and_ends_its_pulses_by_itself():
    _, lines, _, _, _ = on_lines(driver="xid_triggers", peer=XidLinesPeer)

    assert lines.width_ms == 5
    assert lines.log[0][1] == 0


def packets_of_labjack(*commands):
    u3 = pytest.importorskip("u3", reason="pip install LabJackPython")
    sent = []
    device = u3.U3(autoOpen=False)
    device.write = lambda data, checksum=True, **_: sent.append(
        bytes(__import__("LabJackPython").setChecksum(data) if checksum else data)
    )
    device.read = lambda count, **_: [0xFA, 0xF8, 2, 0, 0, 0, 0, 0, 0, 0]
    device.getFeedback(*commands)
    return sent[0]


@pytest.mark.parametrize("code", [0, 1, 128, 255])
def test_packets_are_those_of_labjackpython(code):
    u3 = pytest.importorskip("u3", reason="pip install LabJackPython")
    own = u3.PortStateWrite(State=[0, code, 0], WriteMask=[0, 255, 0])
    assert labjack_codec.set_lines(code) == packets_of_labjack(own)
    out = u3.PortDirWrite(Direction=[0, 255, 0], WriteMask=[0, 255, 0])
    low = u3.PortStateWrite(State=[0, 0, 0], WriteMask=[0, 255, 0])
    assert labjack_codec.lines_out() == packets_of_labjack(low, out)


def test_the_answer_printed_in_labjackpython_is_read_wherever_it_is_cut():
    answer = bytes([0xFA, 0xF8, 2, 0, 0, 0, 0, 0, 0, 0])
    for cut in range(len(answer)):
        reader = labjack_codec.AnswerReader()
        assert [*reader.feed(answer[:cut]), *reader.feed(answer[cut:])] == [0]
        assert reader.unreadable_count == 0


@given(st.binary(max_size=80))
@settings(max_examples=300, deadline=None)
def test_damaged_answers_never_raise(noise):
    reader = labjack_codec.AnswerReader()
    found = list(reader.feed(noise))
    assert len(found) * 8 <= len(noise)


class Kernel:
    """Linux's ppdev as the C library sees it: every request with the byte it brings."""

    def __init__(self, monkeypatch):
        import fcntl

        self.asked = []
        monkeypatch.setattr(os, "open", lambda path, flags: 99)
        monkeypatch.setattr(os, "close", lambda handle: None)
        monkeypatch.setattr(fcntl, "ioctl", self.ioctl)

    def ioctl(self, handle, request, data=0):
        number = request & 0xFFFFFFFF
        value = data if isinstance(data, int) else int.from_bytes(data, "little")
        self.asked.append((number, value))
        return 0


@pytest.mark.skipif(sys.platform != "linux", reason="ppdev is Linux's")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_the_kernel_is_asked_what_pyparallel_asks_it(monkeypatch):
    parallel = pytest.importorskip("parallel", reason="pip install pyparallel")
    kernel = Kernel(monkeypatch)
    port = parallel.Parallel("/dev/parport0")
    port.setData(0xA5)
    port.setData(0)
    theirs, kernel.asked = [a for a in kernel.asked if a[0] & 0xFF in ASKED], []

    link = ParallelLink(SimClock(), "/dev/parport0")
    link.open(1.0)
    link.write(b"\0")
    link.write(b"\xa5\0")
    ours = list(kernel.asked)
    port._fd = None  # or it would be released once more when it is collected
    link.close()
    assert ours == theirs


ASKED = {0x8F, 0x8B, 0x90, 0x86}


class InpOut:
    def __init__(self):
        self.written = []

    def Out32(self, address, value):  # noqa: N802 - the library's name
        self.written.append((address, value))


def test_an_address_is_written_through_inpout():
    library = InpOut()
    link = ParallelLink(SimClock(), "0x378", library)
    link.open(1.0)
    link.write(b"\x05\x00")
    assert library.written == [(0x378, 5), (0x378, 0)]


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX's")
def test_bytes_reach_a_serial_port_in_real_time():
    import pty
    import tty

    mine, theirs = pty.openpty()
    tty.setraw(theirs)
    clock = SystemClock()
    link = SerialLink(clock, port=os.ttyname(theirs), baud=115_200)
    wiring = driver_wiring("serial_triggers")
    device = wiring.on_wire("triggers", clock, link, codes=CODES, width_ms=1.0, settle_ms=0.5)
    device.open(2.0)
    batches = []
    pump = Pump(device, batches.append, clock)
    pump.start()
    device.trigger("trial_start", clock.now_ns())
    device.trigger("flash", clock.now_ns())
    got = b""
    while len(got) < 5:
        got += os.read(mine, 16)
    pump.stop()
    device.close()
    os.close(mine)
    os.close(theirs)
    assert got[:5] == bytes([0, 1, 0, 255, 0])
    rows = rows_of(batches)
    assert (rows["t_released_ns"] - rows["t_before_ns"]).min() >= NS_PER_MS


def test_markers_are_received_by_the_genuine_library(tmp_path):
    pytest.importorskip("pylsl", reason="pip install pylsl")
    settings_file = tmp_path / "lsl_api.cfg"
    settings_file.write_text(
        "[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n"
    )
    child = subprocess.run(
        [sys.executable, "-m", "tests.devices.lsl_triggers_child", str(os.getpid())],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(ROOT), "LSLAPICFG": str(settings_file)},
        cwd=tmp_path,
    )
    assert child.returncode == 0, child.stderr
    told = json.loads(child.stdout.splitlines()[-1])
    assert told["codes"] == [1, 255]
    assert told["type"] == "Markers"
    assert told["between_stamps"]


# ---- in a session ---------------------------------------------------------------------------


def test_marks_of_a_session_are_on_the_lines_and_in_the_recording(tmp_path):
    config = lab(tmp_path)
    options = driver_spec("serial_triggers").options(codes={"trial_start": 1, "trial_end": 2})
    box = DeviceConfig(
        role="triggers", driver="serial_triggers", simulated=True, options=options.model_dump()
    )
    recording = perform(config.model_copy(update={"devices": {**config.devices, "triggers": box}}))

    events = recording.events()
    starts = events.loc[events["name"] == "trial_start", "t_ns"].astype(int).tolist()
    rows = recording.stream_arrays("triggers")
    sent = rows["t_commanded_ns"][rows["code"] == 1].tolist()
    assert sent == starts
    assert rows["code"].tolist() == [1, 2] * len(starts)
    late_ns = rows["t_before_ns"] - rows["t_commanded_ns"]
    assert (late_ns >= 0).all()
    assert late_ns.max() < NS_PER_S // 10

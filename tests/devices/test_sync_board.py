"""The synchronisation board: bytes under damage, its own firmware, its clock, lost blocks."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.devices.byte_links import MemoryLink
from visavis.devices.drivers.armband.codec import FrameReader
from visavis.devices.sim.sync_room import PlantedDelay, SimulatedRoom, SyncBoardSimulator
from visavis.devices.sync.board import SyncBoard
from visavis.devices.sync.board_codec import (
    BLOCK,
    BoardTime,
    Samples,
    decode,
    encode_ask,
    encode_samples,
    encode_time,
)
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock
from visavis.lab.errors import DeviceTimeout

FIRMWARE = Path(__file__).resolve().parents[2] / "firmware" / "sync_board"
US = st.integers(0, 2**32 - 1)


def samples(seq=3, device_us=2**31, levels=None):
    if levels is None:
        levels = np.arange(BLOCK * 3, dtype=np.uint8).reshape(BLOCK, 3)
    return Samples(seq, device_us, 250, levels)


@given(st.binary(min_size=36, max_size=36), US, st.integers(0, 255), st.integers(1, 7))
def test_samples_survive_the_wire_however_it_is_cut(raw, device_us, seq, cut):
    levels = np.frombuffer(raw, np.uint8).reshape(BLOCK, 3)
    data = encode_samples(samples(seq, device_us, levels)) + encode_time(BoardTime(seq, device_us))
    reader = FrameReader()
    frames = [f for i in range(0, len(data), cut) for f in reader.feed(data[i : i + cut])]
    block, board_times = (decode(frame) for frame in frames)

    assert (seq, device_us, 250) == (block.seq, block.device_us, block.period_us)
    np.testing.assert_array_equal(levels, block.levels)
    assert BoardTime(seq, device_us) == board_times


@settings(max_examples=300)
@given(st.integers(0, 47), st.binary(min_size=1, max_size=4), st.booleans())
def test_damaged_frames_are_no_samples_and_raise_nothing(at, noise, inserts):
    intact = encode_samples(samples())
    broken = intact[:at] + noise + intact[at if inserts else at + len(noise) :]
    said = [decode(frame) for frame in FrameReader().feed(b"\0" + broken + b"\0")]

    if intact.strip(b"\0") not in broken.split(b"\0"):
        assert not any(isinstance(one, Samples | BoardTime) for one in said)


def a_board(*, loss_01=0.0, drift_ppm=80.0):
    clock = SimClock(5 * NS_PER_S)
    rng = np.random.default_rng(1)
    room = SimulatedRoom(clock, rng, PlantedDelay(10.0), PlantedDelay())
    peer = SyncBoardSimulator(room, clock, rng, drift_ppm=drift_ppm, loss_01=loss_01)
    return clock, room, SyncBoard(MemoryLink(peer, clock), clock)


def listen(clock, board, seconds):
    until_ns = clock.now_ns() + round(seconds * NS_PER_S)
    while clock.now_ns() < until_ns:
        clock.sleep_until_ns(clock.now_ns() + 5 * NS_PER_MS)
        board.poll()


def test_what_the_board_saw_stands_on_the_sessions_clock():
    clock, room, board = a_board()
    board.open()
    listen(clock, board, 20.0)
    shown_ns = clock.now_ns()
    room.show(True, shown_ns)
    listen(clock, board, 0.5)
    light = board.traces()["light"]

    first_ns = light.t_ns[np.flatnonzero(light.level > 0.5)[0]]
    assert first_ns - shown_ns == pytest.approx(10.125 * NS_PER_MS, abs=0.2 * NS_PER_MS)
    assert 0 == board.loss_count()


def test_lost_blocks_are_counted_and_leave_a_gap():
    clock, _, board = a_board(loss_01=0.05)
    board.open()
    listen(clock, board, 10.0)
    t_ns = board.traces()["light"].t_ns

    in_gaps = np.sum(np.round(np.diff(t_ns) / 250_000) - 1)
    assert board.loss_count() > 0
    assert board.loss_count() == pytest.approx(in_gaps, abs=BLOCK)


class Mute:
    def connect(self, t_ns):
        pass

    def accept(self, data, t_ns):
        pass

    def outgoing(self, until_ns):
        return ()


def test_board_that_is_not_there_is_told_with_what_to_do():
    clock = SimClock()
    with pytest.raises(DeviceTimeout, match="flash firmware/sync_board"):
        SyncBoard(MemoryLink(Mute(), clock), clock).open()


@pytest.mark.skipif(
    not (shutil.which("avr-gcc") and Path("/usr/include/simavr").is_dir()),
    reason="apt-get install gcc-avr avr-libc simavr libsimavr-dev",
)
def test_boards_own_firmware_speaks_this_protocol(tmp_path):
    make = ["make", "-C", str(FIRMWARE), "all", "simulator", f"OUT={tmp_path}"]
    subprocess.run(make, check=True, capture_output=True)
    lines = f"T 20000\nB 30000 ffff{encode_ask(7).hex()}\nT 100000\n"
    command = [str(tmp_path / "sync_board_simavr"), str(tmp_path / "sync_board.elf")]
    done = subprocess.run(command, input=lines, capture_output=True, text=True, check=True)
    said = [line.split() for line in done.stdout.splitlines()]
    reader = FrameReader()
    heard = [decode(f) for f in reader.feed(bytes(int(w[2], 16) for w in said if w[0] == "X"))]
    blocks = [one for one in heard if isinstance(one, Samples)]

    assert 0 == reader.damaged_frame_count
    assert [250 + 3000 * i for i in range(len(blocks))] == [b.device_us for b in blocks]
    assert 32 == len(blocks)
    board_times = [one for one in heard if isinstance(one, BoardTime)]
    assert [7] == [one.seq for one in board_times]
    assert board_times[0].device_us == pytest.approx(30_350, abs=250)
    inputs_v = np.array((3.9 / 4, 3.3 / 4, 3.3 * 512 / 1023))
    for block in blocks:
        expected = np.broadcast_to(inputs_v / 3.3 * 255, (BLOCK, 3))
        np.testing.assert_allclose(block.levels, expected, atol=1.0)

"""Sounds through the card: when they come, where they are heard from, what goes wrong."""

import numpy as np
import pytest

from visavis.devices.contracts import SOUND_EVENTS, DeviceState
from visavis.devices.drivers.sound.driver import SoundCard
from visavis.devices.drivers.sound.mixing import HEAD_RADIUS_M, SOUND_M_S, ear_delays_s, head_shadow
from visavis.devices.drivers.sound.spec import SOUND_CARD
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.sim.sound_card import RATE_HZ, SimulatedPortAudio
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock
from visavis.lab.errors import DeviceDisconnected, DeviceError, DeviceNotFound
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stimuli.sound import Waveform

UPRIGHT = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))


def noise(seconds, rate_hz=RATE_HZ, seed=1):
    rng = np.random.default_rng(seed)
    samples = rng.uniform(-0.3, 0.3, (round(seconds * rate_hz), 1))
    return Waveform("noise", samples.astype(np.float32), rate_hz)


class Played:
    """A card that is streaming on a virtual clock, and what it told."""

    def __init__(self, **card):
        self.clock = SimClock(3 * NS_PER_S)
        self.library = SimulatedPortAudio(self.clock, **card)
        self.device = SoundCard(
            "sound", lambda: self.library, self.clock, spec=SOUND_CARD, is_simulated=True
        )
        self.batches = []
        self.device.open(5.0)
        self.device.start(self.batches.append)
        self.device.hear_from(UPRIGHT)

    def run(self, seconds):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + 11 * NS_PER_MS)
            self.device.poll(0.0)

    def rows(self, event):
        rows = np.concatenate([b.values for b in self.batches])
        return rows[rows["event"] == SOUND_EVENTS.index(event)]

    def heard(self):
        """What came out, from the first block that was not silent: (n, 2), and when it began."""
        t_s = self.library.played_blocks[0][0]
        return np.concatenate([block for _, block in self.library.played_blocks]), t_s


@pytest.mark.parametrize("drift_ppm", [0.0, 80.0, -300.0])
def test_onset_is_when_the_first_sample_leaves_the_card_by_the_sessions_clock(drift_ppm):
    card = Played(latency_ms=23.0, drift_ppm=drift_ppm)
    card.run(20.0)
    card.device.play(noise(0.05))
    card.run(0.2)
    _, card_s = card.heard()
    truly_ns = (card_s - 1000.0) / (1 + drift_ppm * 1e-6) * NS_PER_S
    assert truly_ns == pytest.approx(int(card.rows("began")["t_sounding_ns"][0]), abs=200_000)


def test_what_is_heard_without_a_place_is_the_recording_itself():
    card = Played()
    sound = noise(0.1)
    card.device.play(sound, gain_db=-20.0)
    card.run(0.3)
    out, _ = card.heard()
    assert 0.1 * sound.samples[:, 0] == pytest.approx(out[: len(sound.samples), 0], abs=1e-6)
    assert out[:, 0].tolist() == out[:, 1].tolist()


def test_recording_of_another_rate_keeps_its_pitch_and_length():
    card = Played()
    tone = np.sin(2 * np.pi * 500 * np.arange(8820) / 44_100).astype(np.float32)[:, None] * 0.2
    card.device.play(Waveform("tone", tone, 44_100))
    card.run(0.4)
    out, _ = card.heard()
    strongest = np.argmax(np.abs(np.fft.rfft(out[:9600, 0]))) * RATE_HZ / 9600
    assert 500.0 == pytest.approx(strongest, abs=5.0)
    row = card.rows("ended")["t_sounding_ns"] - card.rows("began")["t_sounding_ns"]
    assert 0.2 * NS_PER_S == pytest.approx(int(row[0]), abs=NS_PER_MS)


@pytest.mark.parametrize(("side", "near", "far"), [(1.0, 1, 0), (-1.0, 0, 1)])
def test_source_at_one_side_comes_first_and_brighter_to_that_ear(side, near, far):
    card = Played()
    sound = noise(0.5)
    card.device.play(sound, at_m=np.array([2.0 * side, 1.2, 0.09]))
    card.run(0.7)
    out, _ = card.heard()
    lags = np.arange(-60, 61)
    together = [np.dot(out[100:20000, near], out[100 + k : 20000 + k, far]) for k in lags]
    later_s = lags[int(np.argmax(together))] / RATE_HZ
    # Woodworth's largest delay, and what the shadow filter adds to it
    assert HEAD_RADIUS_M / SOUND_M_S * (1 + np.pi / 2) == pytest.approx(later_s, abs=1e-4)
    spectrum = np.abs(np.fft.rfft(out[:24000], axis=0))
    high = spectrum[4000:].mean(axis=0)
    assert high[near] > 3 * high[far]


def test_source_stays_in_the_world_when_the_head_turns():
    card = Played()
    card.device.play(noise(1.0), at_m=np.array([3.0, 1.2, 0.0]), loops=True)
    card.run(0.3)
    turned = Pose(UPRIGHT.position_m, quat_from_yaw_pitch_deg(180.0, 0.0))
    card.device.hear_from(turned)
    card.run(0.3)
    out, _ = card.heard()
    before, after = out[2400:9600] ** 2, out[-4800:] ** 2
    assert before[:, 1].mean() > 1.5 * before[:, 0].mean()
    assert after[:, 0].mean() > 1.5 * after[:, 1].mean()


def test_twice_as_far_is_half_as_loud():
    levels = []
    for far_m in (2.0, 4.0):
        card = Played()
        card.device.play(noise(0.5), at_m=np.array([0.0, 1.2, 0.09 - far_m]))
        card.run(0.7)
        levels.append(np.sqrt((card.heard()[0] ** 2).mean()))
    assert 2.0 == pytest.approx(levels[0] / levels[1], rel=0.01)


def test_ears_hear_at_once_what_stands_ahead():
    assert [0.0, 0.0] == pytest.approx(ear_delays_s(np.array([0.0, 0.0, -1.0])), abs=1e-9)


@pytest.mark.parametrize("angle_deg", [0.0, 60.0, 150.0])
def test_head_passes_low_tones_and_shades_high_ones_as_published(angle_deg):
    b, a = head_shadow(angle_deg, RATE_HZ)
    low, high = b.sum() / a.sum(), (b[0] - b[1]) / (a[0] - a[1])
    alpha = 1.05 + 0.95 * np.cos(np.radians(angle_deg * 180 / 150))  # Brown and Duda, eq. 3
    assert (1.0, alpha) == pytest.approx((low, high), abs=1e-9)


def test_sound_that_is_hushed_ends_without_a_click():
    card = Played()
    card.device.play(Waveform("level", np.full((48_000, 1), 0.5, np.float32), RATE_HZ))
    card.run(0.2)
    card.device.hush()
    card.run(0.2)
    out, _ = card.heard()
    assert np.abs(np.diff(out[100:, 0])).max() < 0.01
    assert 1 == len(card.rows("stopped"))


def test_hole_in_the_sound_is_recorded_and_told():
    hole = FaultSchedule((WireFault("loss", 0.5, 0.05, 1.0),))
    card = Played(faults=hole)
    card.device.play(noise(1.0))
    card.run(1.2)
    assert len(card.rows("underflow")) >= 1
    assert "holes in the sound" in card.device.check()[0].message


def test_card_that_goes_and_comes_back_plays_on_and_tells_what_was_not_heard():
    gone = FaultSchedule((WireFault("disconnect", 1.0, 1.0),))
    card = Played(faults=gone)
    card.run(0.8)
    with pytest.raises(DeviceDisconnected, match="sound card stopped"):
        card.run(1.0)
    assert DeviceState.FAULT == card.device.state
    card.device.play(noise(0.1))
    card.run(2.5)
    card.device.play(noise(0.1))
    card.run(0.3)
    assert [1] == card.rows("began")["sound"].tolist()
    assert "1 sounds were not heard" in card.device.check()[0].message


def test_output_that_does_not_exist_is_told_with_what_to_do():
    never = FaultSchedule((WireFault("late_start", 0.0, 1.0),))
    clock = SimClock()
    library = SimulatedPortAudio(clock, faults=never)
    with pytest.raises(DeviceError, match="python -m sounddevice"):
        SoundCard("sound", lambda: library, clock, spec=SOUND_CARD).open(1.0)


def test_name_that_no_output_bears_is_told():
    class Nameless(SimulatedPortAudio):
        def OutputStream(self, **options):  # noqa: N802 - sounddevice's name
            raise ValueError(f"No output device matching {options['device']!r}")

    clock = SimClock()
    library = Nameless(clock)
    card = SoundCard("sound", lambda: library, clock, spec=SOUND_CARD, device="Headset")
    with pytest.raises(DeviceNotFound, match=r"'Headset'.*plug it in"):
        card.open(1.0)


def test_card_that_was_away_when_it_was_stopped_is_opened_again_at_the_start():
    card = Played(faults=FaultSchedule((WireFault("disconnect", 1.0, 1.0),)))
    with pytest.raises(DeviceDisconnected):
        card.run(1.5)
    card.device.stop()
    card.clock.sleep_until_ns(card.clock.now_ns() + NS_PER_S)
    card.device.start(card.batches.append)
    card.device.play(noise(0.1))
    card.run(0.3)
    assert 1 == len(card.rows("began"))


def test_card_that_does_not_stamp_is_recorded_as_such():
    card = Played()
    callback = card.device._stream._callback

    def unstamped(out, n, times, status):
        times.outputBufferDacTime = 0.0  # as some of PortAudio's interfaces have it
        callback(out, n, times, status)

    card.device._stream._callback = unstamped
    card.device.play(noise(0.05))
    card.run(0.2)
    row = card.rows("began")[0]
    assert not row["stamped"]
    truly_ns = (card.heard()[1] - 1000.0) * NS_PER_S
    assert truly_ns == pytest.approx(int(row["t_sounding_ns"]), abs=200_000)

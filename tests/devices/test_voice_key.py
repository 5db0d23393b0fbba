"""A voice key: when somebody began to speak, what is no voice, and a microphone that is gone."""

import contextlib
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from tests.devices.bodies import FixatingBody
from visavis.devices.building import build_device
from visavis.devices.contracts import DeviceState
from visavis.devices.drivers.buttons.keyboard import KeyLink
from visavis.devices.drivers.voice.beside_keys import VoiceAndKeyboard
from visavis.devices.drivers.voice.driver import VoiceKey
from visavis.devices.drivers.voice.onset import OnsetDetector
from visavis.devices.drivers.voice.spec import VOICE_AND_KEYBOARD, VOICE_KEY
from visavis.devices.faults import FaultSchedule, WireFault
from visavis.devices.registry import driver_wiring
from visavis.devices.sim.microphone import SimulatedMicrophone
from visavis.lab.clock import NS_PER_MS, NS_PER_S, SimClock
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import ConfigError, DeviceDisconnected, DeviceNotFound

BEGIN_NS = 3 * NS_PER_S


class Speaker(FixatingBody):
    """Say words at session times (s), with a breath before."""

    def __init__(self, words_s):
        super().__init__(presses=[(round(t_s * NS_PER_S), "voice", 1.0) for t_s in words_s])

    def next_press_ns(self):
        return self._presses[0][0] if self._presses else None


class Key:
    """A voice key that is streaming on a virtual clock, and what it delivered."""

    def __init__(self, words_s=(), *, options=(), **microphone):
        self.clock = SimClock(BEGIN_NS)
        body = Speaker(words_s)
        self.card = SimulatedMicrophone(self.clock, body, **microphone)
        voice_options = VOICE_KEY.checked_options("responses", dict(options))
        self.device = VoiceKey(
            "responses",
            lambda: self.card,
            self.clock,
            spec=VOICE_KEY,
            options=voice_options,
            is_simulated=True,
        )
        self.batches = []
        self.device.open(5.0)
        self.run_idle(0.5)
        self.device.start(self.batches.append)

    def run_idle(self, seconds):
        self.clock.sleep_until_ns(self.clock.now_ns() + round(seconds * NS_PER_S))

    def run(self, seconds, step_ms=11):
        end_ns = self.clock.now_ns() + round(seconds * NS_PER_S)
        while self.clock.now_ns() < end_ns:
            self.clock.sleep_until_ns(self.clock.now_ns() + round(step_ms * NS_PER_MS))
            self.device.poll(0.0)

    def times_s(self, level):
        """Return the session times at which the key went down (1.0) or up (0.0)."""
        rows = [
            (t_ns, value)
            for batch in self.batches
            for t_ns, value in zip(batch.t_host_ns, batch.values["value_01"], strict=True)
        ]
        return [t_ns / NS_PER_S for t_ns, value in rows if value == level]


@pytest.mark.parametrize("noise_db", [-90.0, -75.0, -60.0, -50.0])
@pytest.mark.parametrize("drift_ppm", [0.0, 200.0])
def test_press_is_when_the_voice_began_not_when_it_was_judged(noise_db, drift_ppm):
    words_s = [5.0, 6.1234, 7.707]
    key = Key(words_s, noise_db=noise_db, drift_ppm=drift_ppm)
    key.run(6.0)
    assert words_s == pytest.approx(key.times_s(1.0), abs=0.005)


def test_device_time_is_the_cards_and_the_session_time_follows_its_drift():
    key = Key([40.0], drift_ppm=300.0)
    key.run(38.0)
    card_s = key.batches[0].t_device_ns[0] / NS_PER_S
    assert key.card.card_s(40 * NS_PER_S) == pytest.approx(card_s, abs=0.005)
    assert [40.0] == pytest.approx(key.times_s(1.0), abs=0.005)
    assert len(key.device.clock_pairs()) > 100


def test_key_goes_up_when_it_was_quiet_for_as_long_as_the_lab_says():
    for release_ms in (200.0, 600.0):
        key = Key([5.0], word_s=0.5, options={"release_ms": release_ms})
        key.run(5.0)
        (up_s,) = key.times_s(0.0)
        # what was said fades over some tens of milliseconds until it is no louder than the room
        assert 5.5 + release_ms / 1000 < up_s < 5.65 + release_ms / 1000


def test_pause_between_words_that_is_shorter_does_not_release():
    key = Key([5.0, 5.6], options={"release_ms": 500.0})
    key.run(5.0)
    assert [5.0] == pytest.approx(key.times_s(1.0), abs=0.005)
    assert 1 == len(key.times_s(0.0))


def test_clicks_press_nothing_unless_least_ms_lets_them():
    clicks_ns = [round(t_s * NS_PER_S) for t_s in (5.0, 6.0, 6.01, 7.0)]
    key = Key(clicks_ns=clicks_ns)
    key.run(6.0)
    assert [] == key.times_s(1.0)
    hasty = Key(clicks_ns=clicks_ns, options={"least_ms": 5.0})
    hasty.run(6.0)
    assert hasty.times_s(1.0)


@pytest.mark.parametrize(
    ("loud_ms", "quiet_ms", "presses"),
    [
        (100, 0, 1),
        (10, 9, 1),  # a deep voice: quiet between two pulses for less than 12 ms
        (15, 14, 0),  # claps, none of which lasts for least_ms
        (4, 11, 0),  # a rattle, which is loud for less than half of the time
    ],
)
def test_sound_counts_that_is_loud_for_half_the_time_without_longer_holes(
    loud_ms, quiet_ms, presses
):
    detector = OnsetDetector(48_000, threshold_db=15.0, least_ms=20.0, release_ms=300.0)
    level = np.full(1000, 0.001)
    at_ms = np.arange(600)
    level[400:] = np.where(at_ms % (loud_ms + quiet_ms) < loud_ms, 0.1, 0.001)
    sound = (np.repeat(level, 48) * np.tile([1.0, -1.0], 24_000)).astype(np.float32)
    turns = [
        turn
        for n in range(100)
        for turn in detector.feed(sound[480 * n : 480 * (n + 1)], n * 10 * NS_PER_MS)
    ]
    assert presses == sum(turn.is_down for turn in turns)
    assert all(400 * NS_PER_MS == turn.t_card_ns for turn in turns if turn.is_down)


@pytest.mark.parametrize(("above_db", "presses"), [(12.0, 0), (20.0, 1)])
def test_what_counts_is_threshold_db_above_the_room(above_db, presses):
    key = Key([5.0], voice_db=-60.0 + above_db)
    key.run(4.0)
    assert presses == len(key.times_s(1.0))


def test_another_threshold_counts_what_is_softer():
    key = Key([5.0], voice_db=-48.0, options={"threshold_db": 8.0})
    key.run(4.0)
    assert 1 == len(key.times_s(1.0))


def test_noise_that_rises_slowly_is_the_room_and_a_voice_above_it_is_heard():
    key = Key([24.0])
    for step in range(20):
        key.card.noise_db = -70.0 + 1.5 * step
        key.run(1.0)
    key.run(3.0)
    assert [24.0] == pytest.approx(key.times_s(1.0), abs=0.005)


def test_noise_that_was_switched_on_is_the_room_after_some_seconds():
    key = Key()
    key.run(2.0)
    key.card.noise_db = -35.0
    key.run(9.0)
    assert (1, 0) == (len(key.times_s(1.0)), len(key.times_s(0.0)))
    key.run(6.0)
    assert (1, 1) == (len(key.times_s(1.0)), len(key.times_s(0.0)))


@pytest.mark.parametrize(("voice_db", "presses"), [(-80.0, 0), (-65.0, 1)])
def test_microphone_that_sends_zeros_has_a_floor_of_90_db_below_full_scale(voice_db, presses):
    key = Key([5.0], noise_db=-200.0, voice_db=voice_db)
    key.run(3.0)
    assert presses == len(key.times_s(1.0))


def test_constant_offset_of_a_card_hides_no_voice():
    detector = OnsetDetector(48_000, threshold_db=15.0, least_ms=20.0, release_ms=300.0)
    rng = np.random.default_rng(1)
    loud = np.where(np.arange(48_000) < 24_000, 0.0001, 0.01)
    sound = (0.2 + loud * rng.normal(size=48_000)).astype(np.float32)
    turns = [
        turn
        for n in range(100)
        for turn in detector.feed(sound[480 * n : 480 * (n + 1)], n * 10 * NS_PER_MS)
    ]
    assert [500] == [round(turn.t_card_ns / NS_PER_MS) for turn in turns]


def test_nothing_is_pressed_before_the_room_was_heard():
    detector = OnsetDetector(48_000, threshold_db=15.0, least_ms=20.0, release_ms=300.0)
    assert detector.floor_db is None
    assert [] == detector.feed(np.full(9600, 0.5, np.float32), 0)


def test_who_speaks_already_at_the_start_is_heard_when_they_begin_anew():
    key = Key([3.45, 5.0], word_s=0.4)
    key.run(3.0)
    assert [5.0] == pytest.approx(key.times_s(1.0), abs=0.005)
    assert 1 == len(key.times_s(0.0))


def test_blocks_that_come_late_give_the_same_onset():
    late_blocks = FaultSchedule((WireFault("burst", 1.9, 0.3),))
    key = Key([5.0], faults=late_blocks)
    key.run(3.0)
    assert [5.0] == pytest.approx(key.times_s(1.0), abs=0.005)


def test_sound_that_was_lost_is_told():
    key = Key([5.0], faults=FaultSchedule((WireFault("loss", 1.0, 0.05, 1.0),)))
    key.run(3.0)
    assert [5.0] == pytest.approx(key.times_s(1.0), abs=0.005)
    assert "lost sound" in key.device.check()[0].message


@pytest.mark.parametrize(
    ("kind", "words"), [("disconnect", "stopped"), ("silence", "sends nothin")]
)
def test_microphone_that_is_gone_is_told_once_and_found_again(kind, words):
    key = Key([8.0], faults=FaultSchedule((WireFault(kind, 1.0, 1.5),)))
    with pytest.raises(DeviceDisconnected, match=words):
        key.run(3.0)
    assert DeviceState.FAULT == key.device.state
    key.run(8.5 - key.clock.now_ns() / NS_PER_S)
    assert DeviceState.STREAMING == key.device.state
    assert [8.0] == pytest.approx(key.times_s(1.0), abs=0.005)


def test_key_that_was_down_when_the_microphone_went_presses_anew():
    key = Key([5.0, 8.0], word_s=0.6, faults=FaultSchedule((WireFault("disconnect", 2.3, 0.5),)))
    with pytest.raises(DeviceDisconnected):
        key.run(4.0)
    key.run(4.0)
    assert [5.0, 8.0] == pytest.approx(key.times_s(1.0), abs=0.005)


def test_card_without_stamps_is_told_and_times_are_arrival_less_latency():
    key = Key([5.0])
    callback = key.device._stream._callback

    def without_stamps(data, n, times, status):
        times.inputBufferAdcTime = 0.0  # as some of PortAudio's interfaces have it
        callback(data, n, times, status)

    key.device._stream._callback = without_stamps
    key.run(3.0, step_ms=1)
    assert [5.0] == pytest.approx(key.times_s(1.0), abs=0.006)
    assert "arrival less latency" in key.device.check()[0].message


def test_block_without_a_stamp_that_comes_as_the_device_is_closed_harms_nothing():
    key = Key()
    take = key.device._take
    key.device.close()
    times = SimpleNamespace(currentTime=1.0, inputBufferAdcTime=0.0)
    take(np.zeros((480, 1), np.float32), 480, times, SimpleNamespace(input_overflow=False))


def test_room_in_which_no_voice_could_be_louder_is_told():
    key = Key(noise_db=-10.0)
    key.run(0.5)
    assert "no voice is heard" in key.device.check()[0].message


def test_microphone_that_is_not_there_is_told_with_what_to_do():
    never = FaultSchedule((WireFault("late_start", 0.0, 1.0),))
    with pytest.raises(DeviceNotFound, match="python -m sounddevice"):
        Key(faults=never)


def test_name_that_no_microphone_bears_is_told():
    class Nameless(SimulatedMicrophone):
        def InputStream(self, **options):  # noqa: N802 - sounddevice's name
            raise ValueError(f"No input device matching {options['device']!r}")

    clock = SimClock(BEGIN_NS)
    options = VOICE_KEY.checked_options("responses", {"device": "Headset"})
    library = Nameless(clock, FixatingBody())
    key = VoiceKey("responses", lambda: library, clock, spec=VOICE_KEY, options=options)
    with pytest.raises(DeviceNotFound, match=r"'Headset'.*plug the microphone in"):
        key.open(1.0)


def test_microphone_that_was_away_when_it_was_stopped_is_opened_again_at_the_start():
    key = Key([7.0], faults=FaultSchedule((WireFault("disconnect", 1.0, 1.0),)))
    with pytest.raises(DeviceDisconnected):
        key.run(1.5)
    key.device.stop()
    key.run_idle(1.5)
    key.device.start(key.batches.append)
    key.run(3.0)
    assert [7.0] == pytest.approx(key.times_s(1.0), abs=0.005)


def test_library_that_is_not_installed_is_told_with_the_line_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    key = driver_wiring("voice_key").on_wire("responses", SimClock())
    with pytest.raises(DeviceNotFound, match=r"visavis\[sound\]"):
        key.open(1.0)


@pytest.mark.parametrize(
    "option", [{"threshold_db": 2.0}, {"least_ms": 0.0}, {"release_ms": 10.0}, {"device": 3}]
)
def test_options_that_make_no_sense_are_refused_by_name(option):
    (name,) = option
    with pytest.raises(ConfigError, match=rf"devices\.responses \(voice_key\): {name}"):
        VOICE_KEY.checked_options("responses", option)


# ---- beside the keyboard ----


class Both:
    """A voice key beside a keyboard, in a window that somebody types into."""

    def __init__(self, words_s, **microphone):
        self.clock = SimClock(BEGIN_NS)
        card = SimulatedMicrophone(self.clock, Speaker(words_s), **microphone)
        options = VOICE_AND_KEYBOARD.checked_options("responses", {"keys": {"f": "same"}})
        self.device = VoiceAndKeyboard(
            "responses",
            lambda: card,
            KeyLink(self.clock),
            self.clock,
            spec=VOICE_AND_KEYBOARD,
            options=options,
            is_simulated=True,
        )
        self.rows = []
        self.device.open(5.0)
        self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_S // 2)
        self.device.start(self.take)

    def take(self, batch):
        times_s = (batch.t_host_ns / NS_PER_S).tolist()
        names = [self.device.controls[control] for control in batch.values["control"]]
        levels = batch.values["value_01"].tolist()
        self.rows += zip(times_s, names, levels, strict=True)

    def run(self, until_s, keystrokes=()):
        """Poll every millisecond; `keystrokes` are (time in s, key)."""
        coming = sorted(keystrokes)
        while self.clock.now_ns() < until_s * NS_PER_S:
            self.clock.sleep_until_ns(self.clock.now_ns() + NS_PER_MS)
            if coming and self.clock.now_ns() >= coming[0][0] * NS_PER_S:
                self.device.hear(coming.pop(0)[1], True)
            self.device.poll(0.0)


def test_keys_and_voice_come_in_one_stream_in_the_order_of_their_times():
    both = Both([5.0])
    both.run(6.0, keystrokes=[(4.9, "f"), (5.01, "j"), (5.1, "f")])
    times_s, names, levels = zip(*both.rows, strict=True)
    assert ["same", "voice", "j", "same", "voice"] == list(names)
    assert [1.0, 1.0, 1.0, 1.0, 0.0] == list(levels)
    assert [4.9, 5.0, 5.01, 5.1] == pytest.approx(times_s[:4], abs=0.003)


def test_keys_are_heard_while_the_microphone_is_away():
    both = Both([], faults=FaultSchedule((WireFault("disconnect", 1.0, 9.0),)))
    with pytest.raises(DeviceDisconnected):
        both.run(6.0)
    both.run(6.0, keystrokes=[(5.0, "j")])
    assert [("j", 1.0)] == [row[1:] for row in both.rows]
    assert [5.0] == pytest.approx([row[0] for row in both.rows], abs=0.002)


def test_somebody_simulated_speaks_and_types():
    presses = [(4.0, "trigger"), (4.5, "voice"), (4.9, "j")]
    body = FixatingBody(presses=[(round(t_s * NS_PER_S), name, 1.0) for t_s, name in presses])
    options = VOICE_AND_KEYBOARD.checked_options("responses", {}).model_dump()
    config = DeviceConfig(
        role="responses", driver="voice_and_keyboard", simulated=True, options=options
    )
    clock = SimClock(BEGIN_NS)
    with contextlib.ExitStack() as stack:
        key = build_device(config, clock, body, 1, stack)
        rows = []
        key.open(1.0)
        clock.sleep_until_ns(BEGIN_NS + NS_PER_S // 2)
        key.start(lambda batch: rows.extend(batch.values["control"][batch.values["value_01"] > 0]))
        while clock.now_ns() < 6 * NS_PER_S:
            clock.sleep_until_ns(clock.now_ns() + 11 * NS_PER_MS)
            key.poll(0.0)
        key.close()
    assert ["trigger", "voice", "j"] == [key.controls[control] for control in rows]


@pytest.mark.parametrize(("before_db", "early_ms"), [(12.0, 3), (8.0, 0)])
def test_an_onset_is_where_the_voice_rose_above_two_thirds_of_the_threshold(before_db, early_ms):
    """Sound of 1 kHz: the room, 3 ms somewhat louder, and a voice 30 dB above the room."""
    detector = OnsetDetector(48_000, threshold_db=15, least_ms=20, release_ms=300)
    levels_db = np.repeat([-70.0, -70.0 + before_db, -40.0], [500, 3, 100])
    wave = np.sin(2 * np.pi * np.arange(48) / 48)
    samples = (10 ** (levels_db[:, None] / 20) * wave).ravel().astype(np.float32)
    blocks = samples.reshape(-1, 48 * 3)
    turns = [t for k, b in enumerate(blocks) for t in detector.feed(b, k * 3 * NS_PER_MS)]
    assert [((503 - early_ms) * NS_PER_MS, True)] == turns

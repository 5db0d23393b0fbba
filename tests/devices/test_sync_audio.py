"""The sound card as speaker and sensor, on a stand-in for sounddevice with PortAudio's stamps."""

from types import SimpleNamespace

import numpy as np
import pytest

from visavis.devices.sync.audio import SoundCardSensor, SoundCardSpeaker
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.errors import DeviceError

RATE_HZ = 48_000


class Streams:
    """What sounddevice offers: streams that call back with blocks and their times."""

    class PortAudioError(Exception):
        pass

    def __init__(self):
        self.made = []

    def OutputStream(self, **given):  # noqa: N802 - sounddevice's name
        return self._stream(given)

    def InputStream(self, **given):  # noqa: N802 - sounddevice's name
        return self._stream(given)

    def _stream(self, given):
        if given["device"] == "nothing":
            raise self.PortAudioError("Invalid device")
        if given["device"] == "Headset":
            raise ValueError("No device matching 'Headset'")
        stream = SimpleNamespace(
            samplerate=RATE_HZ, call=given["callback"], start=lambda: None, close=lambda: None
        )
        self.made.append(stream)
        return stream


def test_input_stands_on_the_sessions_clock_although_blocks_are_called_late():
    clock, library = SimClock(), Streams()
    sensor = SoundCardSensor(library, clock)
    sensor.open()
    rng = np.random.default_rng(1)
    n, rate = 480, RATE_HZ * (1 + 60e-6)  # the card's crystal is not the computer's
    for block in range(300):
        begin_s = 1.0 + block * n / rate
        end_s = begin_s + n / rate
        late_s = 0.001 + rng.exponential(0.002)
        clock.sleep_until_ns(max(clock.now_ns(), round((end_s + late_s) * NS_PER_S)))
        waited_s = clock.now_ns() / NS_PER_S - begin_s
        data = np.zeros((n, 2), np.float32)
        if block == 200:
            data[240:, 1] = 0.5
        times = SimpleNamespace(currentTime=77.0 + waited_s, inputBufferAdcTime=77.0)
        library.made[0].call(data, n, times, None)
    trace = sensor.traces()["input_2"]

    on_ns = trace.t_ns[np.flatnonzero(trace.level > 0.2)[0]]
    expected_ns = (1.0 + (200 * n + 241) / rate) * NS_PER_S
    assert expected_ns == pytest.approx(on_ns, abs=100_000)
    assert 0 == sensor.loss_count()


def test_click_begins_with_the_next_block_and_ends():
    library = Streams()
    speaker = SoundCardSpeaker(library)
    out = np.ones((256, 1), np.float32)
    library.made[0].call(out, 256, None, None)
    assert not out.any()
    speaker.click()
    library.made[0].call(out, 256, None, None)
    assert 0.8 == pytest.approx(out[0, 0])
    library.made[0].call(out, 256, None, None)
    assert not out.any()


@pytest.mark.parametrize("name", ["nothing", "Headset"])
def test_input_or_output_that_is_not_there_is_told_with_what_to_do(name):
    with pytest.raises(DeviceError, match="--sensor audio:NAME"):
        SoundCardSensor(Streams(), SimClock(), name).open()
    with pytest.raises(DeviceError, match="--speaker"):
        SoundCardSpeaker(Streams(), name)


def test_input_that_delivers_nothing_is_no_silence():
    sensor = SoundCardSensor(Streams(), SimClock())
    sensor.open()
    with pytest.raises(DeviceError, match="delivered nothing"):
        sensor.traces()

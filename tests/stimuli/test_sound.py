"""WAV files are read as they were written, and refused in words."""

import contextlib
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import wavfile

from visavis.lab.errors import DataError
from visavis.stimuli.audible import Sound, Tone, gain_db_of, tone_waveform
from visavis.stimuli.sound import Waveform, read_sound

RAMP = np.linspace(-0.9, 0.9, 500)
KINDS = {
    "u1": np.round(128 + RAMP * 127).astype(np.uint8),
    "i2": np.round(RAMP * 32767).astype(np.int16),
    "i4": np.round(RAMP * (2**31 - 1)).astype(np.int32),
    "f4": RAMP.astype(np.float32),
    "f8": RAMP,
}


@pytest.mark.parametrize("kind", KINDS)
def test_wav_of_every_kind_of_sample_has_the_same_values(kind, tmp_path):
    wavfile.write(tmp_path / "ramp.wav", 22_050, KINDS[kind])
    sound = read_sound(tmp_path / "ramp.wav")
    assert RAMP == pytest.approx(sound.samples[:, 0], abs=0.012)
    assert (22_050, "ramp") == (sound.rate_hz, sound.name)


def test_wav_of_24_bits_has_its_values(tmp_path):
    values = np.round(RAMP * (2**23 - 1)).astype(int)
    data = b"".join(int(v).to_bytes(3, "little", signed=True) for v in values)
    head = struct.pack("<4sI4s4sIHHIIHH4sI", b"RIFF", 36 + len(data), b"WAVE", b"fmt ", 16, 1, 1,
                       48_000, 144_000, 3, 24, b"data", len(data))  # fmt: skip
    (tmp_path / "ramp.wav").write_bytes(head + data)
    assert RAMP == pytest.approx(read_sound(tmp_path / "ramp.wav").samples[:, 0], abs=1e-5)


@pytest.mark.parametrize(
    ("samples", "rate_hz", "told"),
    [
        (np.zeros((9, 6), np.int16), 48_000, "6 channels"),
        (np.zeros(0, np.int16), 48_000, "more than none"),
        (np.zeros(9, np.int16), 50, "samples a second"),
        (np.array([0.0, np.nan]), 48_000, "not numbers"),
    ],
)
def test_what_cannot_be_played_is_refused_in_words(samples, rate_hz, told, tmp_path):
    wavfile.write(tmp_path / "odd.wav", rate_hz, samples)
    with pytest.raises(DataError, match=told):
        read_sound(tmp_path / "odd.wav")


def test_flac_has_the_values_that_were_written(tmp_path):
    av = pytest.importorskip("av")
    values = np.round(RAMP * 32767).astype(np.int16)
    with av.open(str(tmp_path / "ramp.flac"), "w") as file:
        stream = file.add_stream("flac", rate=8000)
        stream.codec_context.layout, stream.codec_context.format = "mono", "s16"
        frame = av.AudioFrame.from_ndarray(values[None], format="s16", layout="mono")
        frame.sample_rate = 8000
        file.mux([*stream.encode(frame), *stream.encode(None)])
    sound = read_sound(tmp_path / "ramp.flac")
    assert (values / 32768).tolist() == sound.samples[:, 0].tolist()
    whole = (tmp_path / "ramp.flac").read_bytes()
    (tmp_path / "cut.flac").write_bytes(whole[: len(whole) - 300])
    with pytest.raises(DataError, match=r"cut\.flac"):
        read_sound(tmp_path / "cut.flac")


def test_damaged_packed_file_says_what_is_wrong_and_not_its_name_twice(tmp_path):
    pytest.importorskip("av")
    (tmp_path / "bad.flac").write_bytes(b"fLaC" + bytes(200))
    with pytest.raises(DataError, match=r"bad\.flac: a damaged sound \(Invalid data"):
        read_sound(tmp_path / "bad.flac")


def test_file_that_ends_early_is_told(tmp_path):
    wavfile.write(tmp_path / "ramp.wav", 8000, KINDS["i2"])
    (tmp_path / "cut.wav").write_bytes((tmp_path / "ramp.wav").read_bytes()[:500])
    with pytest.raises(DataError, match=r"cut\.wav: cut short"):
        read_sound(tmp_path / "cut.wav")


def test_tone_rises_and_falls_in_five_milliseconds_and_has_its_pitch_and_level():
    tone = tone_waveform(Tone(440, seconds=0.2))
    edge = np.abs(tone.samples[:, 0])
    assert edge[:48].max() < 0.1  # the first of its five milliseconds
    assert edge[-48:].max() < 0.1
    assert 1.0 == pytest.approx(edge[240:-240].max(), abs=1e-3)
    assert (9600, 440.0) == (len(edge), tone.pitch_hz)
    assert 0.0 == pytest.approx(tone.level_db, abs=0.2)


def test_sound_for_one_ear_is_silent_at_the_other():
    left = tone_waveform(Tone(440, ear="left"))
    assert left.samples[:, 0].any()
    assert not left.samples[:, 1].any()


def test_level_of_a_sound_is_that_of_its_root_mean_square():
    noise = Waveform("noise", np.full((100, 1), 0.1, np.float32), 8000)
    gain_db = gain_db_of(Sound("noise.wav", level_db=-30.0), noise)
    assert -30.0 == pytest.approx(noise.level_db + gain_db)
    assert 0.0 == gain_db_of(Sound("noise.wav"), noise)


def test_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(DataError, match=r"nowhere\.wav"):
        read_sound(tmp_path / "nowhere.wav")


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 400), st.binary(max_size=30))
def test_damaged_file_is_refused_or_read_but_never_breaks(tmp_path_factory, at, junk):
    path = tmp_path_factory.mktemp("sound") / "ramp.wav"
    wavfile.write(path, 8000, KINDS["i2"])
    whole = path.read_bytes()
    path.write_bytes(whole[:at] + junk + whole[at + len(junk) :])
    with contextlib.suppress(DataError):
        assert np.isfinite(read_sound(path).samples).all()

"""Give a film its sound: pictures are copied as they are, the sound is encoded beside them."""

from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.stage.errors import StageError
from visavis.stimuli.sound import Waveform

RATE_HZ: Final = 48_000
CODECS: Final = {".webm": ("libopus", 64_000, "flt"), ".mp4": ("aac", 128_000, "fltp")}
"""By the film's ending: encoder, bits a second, and how it takes samples."""


def add_sound(silent: Path, path: Path, sound: Waveform) -> None:
    """Write a film with sound to `path`: both begin together; the sound ends with the pictures.

    Raises:
        StageError: the ending has no sound here, or PyAV is not installed or fails.
    """
    ending = path.suffix.lower()
    if ending not in CODECS:
        raise StageError(
            f"{path}: films of this kind carry no sound here", remedy="name it .webm or .mp4"
        )
    try:
        import av  # of the extra "browser"
    except ImportError as problem:
        raise StageError(
            f"{path}: sound in films needs PyAV, which is not installed",
            remedy="run: pip install 'visavis[browser]'",
        ) from problem
    try:
        with (
            av.open(str(silent)) as pictures,
            av.open(str(path), "w", options={"fflags": "+bitexact"}) as film,
        ):
            of = pictures.streams.video[0]
            video = film.add_stream_from_template(of)
            # Packets go out in the order of time, so that a player never waits for either.
            frames: list[tuple[float, Any]] = []
            seconds, tick_s = 0.0, float(of.time_base or 0)
            for packet in pictures.demux(of):
                if packet.dts is not None and packet.pts is not None:
                    frames.append((packet.dts * tick_s, packet))
                    seconds = max(seconds, (packet.pts + (packet.duration or 0)) * tick_s)
            sounds = _sound_packets(film, ending, sound, seconds)
            for _, packet in sorted(frames + sounds, key=lambda row: row[0]):
                if packet.stream is of:
                    packet.stream = video
                film.mux(packet)
    except av.error.FFmpegError as problem:
        path.unlink(missing_ok=True)
        raise StageError(f"{path}: the sound could not be added ({problem})") from problem


def _sound_packets(
    film: Any, ending: str, sound: Waveform, seconds: float
) -> list[tuple[float, Any]]:
    """Return the encoded sound, each packet with its time."""
    import av

    codec, bit_rate, layout_of_samples = CODECS[ending]
    sounds = sound.at_rate(RATE_HZ).samples
    whole = np.zeros((round(seconds * RATE_HZ), sounds.shape[1]), np.float32)
    whole[: len(sounds)] = sounds[: len(whole)]
    stream = film.add_stream(codec, rate=RATE_HZ)
    stream.bit_rate = bit_rate
    layout = "mono" if whole.shape[1] == 1 else "stereo"
    stream.codec_context.layout = layout
    stream.codec_context.format = layout_of_samples
    packets: list[tuple[float, Any]] = []
    step = RATE_HZ // 50
    for first in range(0, len(whole), step):
        rows = whole[first : first + step]
        is_planar = layout_of_samples.endswith("p")
        samples = np.ascontiguousarray(rows.T) if is_planar else rows.reshape(1, -1)
        frame = av.AudioFrame.from_ndarray(samples, format=layout_of_samples, layout=layout)
        frame.sample_rate, frame.pts, frame.time_base = RATE_HZ, first, Fraction(1, RATE_HZ)
        packets += [(float(p.dts * p.time_base), p) for p in stream.encode(frame)]
    packets += [(float(p.dts * p.time_base), p) for p in stream.encode(None)]
    return packets

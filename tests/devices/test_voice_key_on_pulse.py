"""The voice key on the genuine sounddevice: a sound server's monitor is its microphone."""

import contextlib
import json
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from tests.devices.voice_key_child import TONE_S
from tests.sound_server import SERVER_PATIENCE_S, sound_server
from visavis.lab.clock import NS_PER_S

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]  # five seconds of a real clock


@contextlib.contextmanager
def fast_monitor(here: Mapping[str, str]) -> Iterator[None]:
    """Keep the monitor of speakers that nobody hears from sending sound seconds late, as it does
    until a client asks for less.
    """
    listen = ["parec", "-d", "ears.monitor", "--latency-msec=10"]
    client = subprocess.Popen(listen, env=here, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        client.send_signal(signal.SIGTERM)
        client.wait(timeout=SERVER_PATIENCE_S)


def test_tone_in_a_real_microphone_presses_while_it_sounds(tmp_path: Path) -> None:
    try:
        import sounddevice  # noqa: F401 - only to see whether PortAudio is there
    except (ImportError, OSError):
        pytest.skip("PortAudio is not installed: apt-get install libportaudio2 libasound2-plugins")
    with sound_server(tmp_path / "pulse") as here, fast_monitor(here):
        child = subprocess.run(
            [sys.executable, "-m", "tests.devices.voice_key_child"],
            env={**here, "PULSE_SOURCE": "ears.monitor"},
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
    if "No input device matching 'pulse'" in child.stderr:
        pytest.skip("ALSA does not reach PulseAudio: apt-get install libasound2-plugins")
    assert 0 == child.returncode, child.stderr
    report = json.loads(child.stdout)
    times_ns, levels = zip(*report["rows"], strict=True)
    begin_ns, end_ns = report["player_ns"]
    # The server may stretch the tone by holes while the computer is busy.
    assert [1.0, 0.0] * (len(levels) // 2) == list(levels)
    assert begin_ns - 0.1 * NS_PER_S < times_ns[0] < end_ns
    assert TONE_S + 0.25 < (times_ns[-1] - times_ns[0]) / NS_PER_S

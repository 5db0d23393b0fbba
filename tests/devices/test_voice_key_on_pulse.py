"""The voice key on the genuine sounddevice: a sound server's monitor is its microphone."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.devices.voice_key_child import TONE_S
from tests.sound_server import sound_server
from visavis.lab.clock import NS_PER_S

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]  # five seconds of a real clock


def test_tone_in_a_real_microphone_presses_while_it_sounds(tmp_path: Path) -> None:
    try:
        import sounddevice  # noqa: F401 - only to see whether PortAudio is there
    except (ImportError, OSError):
        pytest.skip("PortAudio is not installed: apt-get install libportaudio2 libasound2-plugins")
    with sound_server(tmp_path / "pulse") as here:
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
    heard = json.loads(child.stdout)
    (down_ns, down), (up_ns, up) = heard["rows"]
    begin_ns, end_ns = heard["player_ns"]
    assert (1.0, 0.0) == (down, up)
    assert begin_ns - 0.1 * NS_PER_S < down_ns < end_ns
    assert TONE_S + 0.3 == pytest.approx((up_ns - down_ns) / NS_PER_S, abs=0.05)

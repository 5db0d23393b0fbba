"""A sound server of a test's own, whose speakers `ears` nobody hears."""

import contextlib
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

from visavis.lab.clock import StopWatch, SystemClock

SPEAKER_HZ = 48_000
SERVER_PATIENCE_S = 60


@contextlib.contextmanager
def sound_server(folder: Path) -> Iterator[Mapping[str, str]]:
    """Run a server that lives in a folder; yields the environment of its clients.

    Skips the test where PulseAudio is not installed.
    """
    if not (shutil.which("pulseaudio") and shutil.which("parec")):
        pytest.skip("there is no sound server; apt install pulseaudio pulseaudio-utils")
    folder.mkdir(mode=0o700)
    socket = folder / "socket"
    here = os.environ | {"HOME": str(folder), "XDG_RUNTIME_DIR": str(folder)}
    load = [
        f"module-null-sink sink_name=ears rate={SPEAKER_HZ}",
        f"module-native-protocol-unix auth-anonymous=1 socket={socket}",
    ]
    words = ["pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1", "--disallow-exit"]
    words += [word for module in load for word in ("-L", module)]
    server = subprocess.Popen(words, env=here, stderr=subprocess.DEVNULL)
    try:
        clock, watch = SystemClock(), StopWatch()
        while not socket.exists():
            assert watch.elapsed_s() < SERVER_PATIENCE_S, "the sound server did not start"
            clock.sleep_until_ns(clock.now_ns() + 50_000_000)
        yield here | {"PULSE_SERVER": f"unix:{socket}"}
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(timeout=SERVER_PATIENCE_S)

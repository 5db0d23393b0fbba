"""FoveClient as a C library compiled here, fed by the simulator."""

import ctypes
import shutil
import subprocess
import threading
from pathlib import Path

from visavis.devices.sim.fove import FRAME, FoveSimulator
from visavis.lab.clock import NS_PER_MS, Clock
from visavis.lab.errors import DeviceNotFound

STUB_SOURCE = Path(__file__).parents[1] / "native" / "fove_stub.c"


def build_stub(folder: Path) -> Path:
    """Compile the C library into a folder; raises DeviceNotFound without a C compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise DeviceNotFound("there is no C compiler (cc)", remedy="install gcc or clang")
    library = folder / "libFoveClient.so"
    command = [compiler, "-shared", "-fPIC", "-O1", "-Wall", "-Werror", "-pthread"]
    subprocess.run(
        [*command, "-o", str(library), str(STUB_SOURCE)], check=True, capture_output=True
    )
    return library


class FoveStub:
    """Feed a compiled stub from a simulator, in a thread, in real time; a context manager."""

    def __init__(self, library: Path, simulator: FoveSimulator, clock: Clock) -> None:
        self._library = ctypes.CDLL(str(library))
        self._simulator = simulator
        self._clock = clock
        self._stopping = threading.Event()
        self._library.fove_stub_reset()
        self._thread = threading.Thread(target=self._serve, name="fove-stub", daemon=True)

    def __enter__(self) -> "FoveStub":
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stopping.set()
        self._thread.join()

    def fail(self, function: str, code: int) -> None:
        """Make a function of the library return an error code; 0 mends it."""
        self._library.fove_stub_fail(function.encode(), ctypes.c_int(code))

    def set_connected(self, connected: bool) -> None:
        """Plug the headset in or out."""
        self._library.fove_stub_connected(int(connected))

    def push(self, frame: bytes) -> None:
        """Store an eye frame as the newest one and wake the callers that wait."""
        self._library.fove_stub_push(frame)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            now_ns = self._clock.now_ns()
            self._simulator.advance(now_ns)
            for message in self._simulator.outgoing(now_ns):
                if len(message.frames[0]) == FRAME.size:
                    self.push(message.frames[0])
            self._clock.sleep_until_ns(now_ns + NS_PER_MS)

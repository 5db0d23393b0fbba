"""SRanipal as a C library compiled here, with the controls that tests need."""

import ctypes
from pathlib import Path

from visavis.devices.sim.native_build import build_library

SOURCE = Path(__file__).parents[1] / "native" / "sranipal_stub.c"


def built_library() -> Path:
    """Compile the stand-in for SRanipal; raises DeviceNotFound without a C compiler."""
    return build_library(str(SOURCE), {}, "sranipal.so")


class StandIn:
    """The controls of the stand-in for tests: its frame and its return codes."""

    def __init__(self, path: Path) -> None:
        self._native = ctypes.CDLL(str(path))
        self.size: int = self._native.visavis_size()

    def hold(self, data: bytes) -> None:
        """Return this frame to every caller."""
        self._native.visavis_hold(data, len(data))

    def answer_with(self, start: int, data: int, is_vive_pro_eye: bool) -> None:
        """Answer with these codes from now on."""
        self._native.visavis_answer(start, data, int(is_vive_pro_eye))

    def offsets(self) -> list[int]:
        """Return the offsets of the structure's members, as the C compiler lays them out."""
        offsets = (ctypes.c_int * 8)()
        self._native.visavis_offsets(offsets)
        return list(offsets)

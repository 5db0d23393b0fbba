"""VarjoLib as a C library compiled here, with the controls that tests need."""

import ctypes
from pathlib import Path

from visavis.devices.sim.native_build import build_library

SOURCE = Path(__file__).parents[1] / "native" / "varjo_stub.c"


def built_library() -> Path:
    """Compile the stand-in for VarjoLib; raises DeviceNotFound without a C compiler."""
    return build_library(str(SOURCE), {}, "varjo.so")


class VarjoStandIn:
    """The controls of the stand-in for tests: its data, its state and what it was asked."""

    def __init__(self, path: Path) -> None:
        self._native = ctypes.CDLL(str(path))
        self._native.visavis_asked.restype = ctypes.c_char_p
        self.set()

    def push(self, datum: bytes) -> None:
        """Hold one datum until it is fetched."""
        self._native.visavis_push(datum)

    def set(
        self,
        *,
        available: bool = True,
        allowed: bool = True,
        init_error: int = 0,
        calibrated: bool = False,
        quality: int = 0,
    ) -> None:
        """Set what the system says; what was held is discarded."""
        self._native.visavis_set(
            int(available), int(allowed), ctypes.c_int64(init_error), int(calibrated), quality
        )

    @property
    def asked(self) -> tuple[str, str]:
        """The filter and the rate that were asked for."""
        return tuple(self._native.visavis_asked(i).decode() for i in (0, 1))

    @property
    def session_count(self) -> int:
        """Sessions that are begun and not ended."""
        return int(self._native.visavis_sessions())

    def layout(self) -> list[int]:
        """Return sizes and offsets of the structures, as the C compiler lays them out."""
        found = (ctypes.c_int * 8)()
        self._native.visavis_layout(found)
        return list(found)

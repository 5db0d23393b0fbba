"""Read an OpenXR runtime's clock at an instant of the session's clock.

Linux runtimes convert CLOCK_MONOTONIC (XR_KHR_convert_timespec_time), those of Windows its
performance counter (XR_KHR_win32_convert_performance_counter_time).
"""

import ctypes
import platform
from collections.abc import Callable, Iterable
from typing import Any

from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceNotFound

TIMESPEC = "XR_KHR_convert_timespec_time"
PERFORMANCE_COUNTER = "XR_KHR_win32_convert_performance_counter_time"

READINGS = 5

FROM_COUNTER = ctypes.CFUNCTYPE(
    ctypes.c_int32, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int64), ctypes.POINTER(ctypes.c_int64)
)
"""xrConvertWin32PerformanceCounterToTimeKHR, which pyopenxr declares on Windows alone."""


def time_extension(offered_extensions: Iterable[str]) -> str:
    """Return the extension that converts this computer's clock.

    Raises:
        DeviceNotFound: the runtime offers none.
    """
    names = (TIMESPEC, PERFORMANCE_COUNTER)
    extensions = [name for name in names if name in offered_extensions]
    if extensions:
        return extensions[-1] if platform.system() == "Windows" else extensions[0]
    raise DeviceNotFound(
        f"the OpenXR runtime offers neither {' nor '.join(names)}, so its times mean nothing here",
        remedy="use SteamVR or Monado as the OpenXR runtime, or another driver",
    )


class RuntimeTime:
    """Ask a runtime for its time; `counter` reads the performance counter where that is used."""

    def __init__(
        self, xr: Any, instance: Any, clock: Clock, extension: str, counter: Callable[[], int]
    ) -> None:
        self._xr = xr
        self._instance = instance
        self._clock = clock
        self._counter = counter
        self._convert: Any = None
        if extension == PERFORMANCE_COUNTER:
            name = "xrConvertWin32PerformanceCounterToTimeKHR"
            address = xr.get_instance_proc_addr(instance, name)
            self._convert = ctypes.cast(address, FROM_COUNTER)

    def now(self) -> tuple[int, int]:
        """Return the session's clock in ns and the runtime's XrTime of the same instant."""
        xr, now_ns = self._xr, self._clock.now_ns()
        if self._convert is None:
            stamp = xr.timespec(now_ns // NS_PER_S, now_ns % NS_PER_S)
            return now_ns, int(xr.convert_timespec_time_to_time_khr(self._instance, stamp).value)
        now_ns, read = self._paired()
        ticks, xr_time = ctypes.c_int64(read), ctypes.c_int64()
        instance = ctypes.cast(self._instance, ctypes.c_void_p)
        result = self._convert(instance, ctypes.byref(ticks), ctypes.byref(xr_time))
        problem = xr.check_result(xr.Result(result))
        if problem.is_exception():
            raise problem
        return now_ns, int(xr_time.value)

    def _paired(self) -> tuple[int, int]:
        """Return session time and counter of one instant: the closest of a few readings.

        Both are the performance counter; this thread may be interrupted between two readings.
        """
        best = (2**62, 0, 0)
        for _ in range(READINGS):
            before_ns = self._clock.now_ns()
            ticks = self._counter()
            after_ns = self._clock.now_ns()
            best = min(best, (after_ns - before_ns, (before_ns + after_ns) // 2, ticks))
        return best[1], best[2]


def performance_counter() -> int:
    """Return the ticks of the Windows performance counter.

    Raises:
        DeviceNotFound: this is not Windows.
    """
    windows = getattr(ctypes, "windll", None)
    if windows is None:
        raise DeviceNotFound(
            "this OpenXR runtime tells its time by the Windows performance counter alone",
            remedy="use a runtime made for this system",
        )
    ticks = ctypes.c_int64()
    windows.kernel32.QueryPerformanceCounter(ctypes.byref(ticks))
    return int(ticks.value)

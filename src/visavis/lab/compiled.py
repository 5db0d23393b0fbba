"""Compile numeric kernels with numba, typed, and keep the machine code in the user's cache folder.

numba keys it by module, source, types and processor; here also by the versions of Python and numba.
`NUMBA_CACHE_DIR` puts it elsewhere.
"""

import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numba.core.event import Listener, register
from numba.core.registry import CPUDispatcher
from numba.np import linalg
from platformdirs import user_cache_path

F = TypeVar("F", bound=Callable[..., object])
_STAMP = "visavis_stamp"
MAX_KERNEL_BYTES: Final = 500_000_000
"""Some ten versions of Visavis, each with every kernel."""
KERNELS: Final = user_cache_path("visavis", appauthor=False) / "kernels"
_config: Any = numba.config  # whose names are made at run time
if not _config.CACHE_DIR:
    _versions = f"py{sys.version_info.major}{sys.version_info.minor}-numba{numba.__version__}"
    _config.CACHE_DIR = str(KERNELS / _versions)


def _put_off_scipy() -> None:
    """Have numba look whether there is SciPy without importing all of its linear algebra, 0.1 s of
    every command that uses a kernel. Kernels that multiply matrices import it as ever.
    """
    ensure: Any = getattr(linalg, "ensure_blas", None)

    def find_blas() -> None:
        linalg.ensure_blas = ensure  # only the first to ask asks in vain
        if find_spec("scipy") is None:
            ensure()

    # numba asks as it loads this module, before the first kernel runs.
    if ensure is not None and "numba.np.arraymath" not in sys.modules:
        linalg.ensure_blas = find_blas


_put_off_scipy()


def compiled(function: F) -> F:
    """Compile a function of arrays and scalars; the machine code is kept for the next process.

    No fast-math: results must repeat bit for bit. Code cached before another kernel or a number
    that its module imports has changed is not used again.
    """
    kernel: Any = numba.njit(cache=True, nogil=True)(function)
    # numba itself looks at one source file alone; where its cache is made otherwise than known,
    # nothing is cached: slower to start, never old code.
    file: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if not hasattr(file, "_source_stamp"):
        return cast(F, numba.njit(nogil=True)(function))
    stamp = (file._source_stamp, _digest_of_imports(function.__globals__))  # noqa: SLF001 - as above
    file._source_stamp = stamp  # noqa: SLF001 - as above
    setattr(kernel, _STAMP, stamp)
    return cast(F, kernel)


class _FirstCompilation(Listener):
    """Hears of every compilation, and tells of the first alone."""

    def __init__(self, on_first: Callable[[], None]) -> None:
        self._on_first: Callable[[], None] | None = on_first

    def on_start(self, event: object) -> None:
        """Tell once; machine code that was kept is loaded without any event."""
        on_first, self._on_first = self._on_first, None
        if on_first is not None:
            on_first()

    def on_end(self, event: object) -> None:
        """Let it pass."""


def announce_compiling(on_first: Callable[[], None]) -> None:
    """Have `on_first` called once, as the first kernel begins to be compiled: none of it was kept.

    That takes seconds for one kernel, and a minute or two for all of them.
    """
    register("numba:compile", _FirstCompilation(on_first))  # type: ignore[no-untyped-call]  # numba's


def forget_old_kernels(folder: Path = KERNELS, max_bytes: int = MAX_KERNEL_BYTES) -> None:
    """Delete the machine code that was made first, beyond so many bytes; a lost one is made again.

    That of one module goes together, as numba's index and its files belong to each other.
    """
    kernels: list[tuple[int, int, list[Path]]] = []
    for module in folder.glob("*/*"):
        with suppress(OSError):  # another process deletes it, too
            files = [path for path in module.iterdir() if path.suffix in (".nbi", ".nbc")]
            sizes = [path.stat() for path in files]
            newest_ns = max((one.st_mtime_ns for one in sizes), default=0)
            kernels.append((newest_ns, sum(one.st_size for one in sizes), files))
    total_bytes = 0
    for _, size_bytes, files in sorted(kernels, key=lambda one: one[0], reverse=True):
        total_bytes += size_bytes
        for path in files if total_bytes > max_bytes else ():
            with suppress(OSError):
                path.unlink()


def _digest_of_imports(names: dict[str, Any]) -> str:
    """Return a digest of everything compiled code of a module may have taken in from others."""
    digest = hashlib.sha256()
    for line in sorted(_taken_in(names)):
        digest.update(line.encode())
    return digest.hexdigest()


def _taken_in(names: dict[str, Any], prefix: str = "") -> Iterator[str]:
    for name, value in list(names.items()):
        if name.startswith("__"):
            continue
        if isinstance(value, CPUDispatcher):
            yield f"{prefix}{name}={getattr(value, _STAMP, None)}"
        elif _is_plain(value):
            yield f"{prefix}{name}={value!r}"
        elif isinstance(value, np.ndarray):
            yield f"{prefix}{name}={value.dtype}{value.shape}{value.tobytes().hex()}"
        elif isinstance(value, ModuleType) and not prefix and _may_change(value):
            yield from _taken_in(vars(value), f"{name}.")


def _may_change(module: ModuleType) -> bool:
    """Return whether numbers of a module are written by hand, here or by a lab."""
    return module.__name__.partition(".")[0] not in {*sys.stdlib_module_names, "numpy", "numba"}


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(_is_plain(part) for part in value)
    return isinstance(value, bool | int | float | complex | str)

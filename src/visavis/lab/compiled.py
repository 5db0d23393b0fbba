"""Compile numeric kernels with numba, typed, and keep the machine code in the user's cache folder.

numba keys it by module, source, types and processor; here also by the versions of Python and numba.
`NUMBA_CACHE_DIR` puts it elsewhere.
"""

import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
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
MADE: Final[list[Any]] = []
"""Every kernel of the modules that this process has imported."""
_config: Any = numba.config  # whose names are made at run time
if not _config.CACHE_DIR:
    _versions = f"py{sys.version_info.major}{sys.version_info.minor}-numba{numba.__version__}"
    _config.CACHE_DIR = str(KERNELS / _versions)


def _put_off_scipy() -> None:
    """Let numba check that SciPy is installed without importing its linear algebra. That import
    costs 0.1 s in every command that uses a kernel; kernels that multiply matrices still import it.
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

    No fast-math, because results must repeat bit for bit. Cached code is discarded when a kernel or
    a number that its module imports has changed.
    """
    kernel: Any = numba.njit(cache=True, nogil=True)(function)
    # numba itself looks at one source file alone; where its cache is made otherwise than known,
    # nothing is cached: slower to start, never old code.
    file: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if not hasattr(file, "_source_stamp"):
        return cast(F, numba.njit(nogil=True)(function))
    stamp = (file._source_stamp, _digest_of_imports(function.__globals__))  # noqa: SLF001 - as above
    file._source_stamp = stamp  # noqa: SLF001 - as above
    file._load_index = partial(_loaded_index, file._load_index)  # noqa: SLF001 - as above
    setattr(kernel, _STAMP, stamp)
    MADE.append(kernel)
    return cast(F, kernel)


def _loaded_index(load: Callable[[], dict[Any, Any]]) -> dict[Any, Any]:
    """Return what is cached of a kernel, nothing when it took tuples that are no longer there.

    numba reads the types of all arguments before it compares the stamps.
    """
    try:
        return load()
    except (AttributeError, ImportError):
        return {}


class _FirstCompilation(Listener):
    """Calls a function at the first compilation, and never again."""

    def __init__(self, on_first: Callable[[], None]) -> None:
        self._on_first: Callable[[], None] | None = on_first

    def on_start(self, event: object) -> None:
        """Call the function once; cached machine code is loaded without any event."""
        on_first, self._on_first = self._on_first, None
        if on_first is not None:
            on_first()

    def on_end(self, event: object) -> None:
        """Do nothing."""


def announce_compiling(on_first: Callable[[], None]) -> None:
    """Call `on_first` once, when the first kernel without cached machine code is compiled.

    One kernel takes seconds, all of them take one or two minutes.
    """
    register("numba:compile", _FirstCompilation(on_first))  # type: ignore[no-untyped-call]  # numba's


def forget_old_kernels(folder: Path = KERNELS, max_bytes: int = MAX_KERNEL_BYTES) -> None:
    """Delete the oldest machine code beyond `max_bytes`; deleted kernels are compiled again when
    needed.

    The files of one module are deleted together, because numba's index refers to all of them.
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
    """Return a digest of all kernels, constants and layouts of tuples that a module imports and
    its compiled code may contain.
    """
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
        elif _is_named_tuple(value):
            yield f"{prefix}{name}={_fields_of(value)}"
        elif _is_plain(value):
            yield f"{prefix}{name}={value!r}"
        elif isinstance(value, np.ndarray):
            yield f"{prefix}{name}={value.dtype}{value.shape}{value.tobytes().hex()}"
        elif isinstance(value, ModuleType) and not prefix and _may_change(value):
            yield from _taken_in(vars(value), f"{name}.")


def _is_named_tuple(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields")


def _fields_of(named_tuple: Any) -> str:
    """Return the names of a tuple's fields in their order, and those of tuples among them: compiled
    code reads them by position.
    """
    kinds = vars(named_tuple).get("__annotations__", {})  # none where it has no types
    return ", ".join(
        f"{name}({_fields_of(kinds[name])})" if _is_named_tuple(kinds.get(name)) else name
        for name in named_tuple._fields
    )


def _may_change(module: ModuleType) -> bool:
    """Return whether a module's constants may change: it is ours or a lab's, not a library."""
    return module.__name__.partition(".")[0] not in {*sys.stdlib_module_names, "numpy", "numba"}


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(_is_plain(part) for part in value)
    return isinstance(value, bool | int | float | complex | str)

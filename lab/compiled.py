"""Compile numeric kernels with numba, typed."""

import hashlib
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core.registry import CPUDispatcher

F = TypeVar("F", bound=Callable[..., object])
_STAMP = "visavis_stamp"


def compiled(function: F) -> F:
    """Compile a function of arrays and scalars; the machine code is cached beside the module.

    No fast-math: results must repeat bit for bit. Code cached before another kernel or a number
    that its module imports has changed is not used again.
    """
    kernel: Any = numba.njit(cache=True, nogil=True)(function)
    # numba itself looks at one source file alone; where its cache is made otherwise than known,
    # nothing is cached: slower to start, never old code.
    file: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    if not hasattr(file, "_source_stamp"):
        return cast(F, numba.njit(nogil=True)(function))
    stamp = (file._source_stamp, _imported(function.__globals__))  # noqa: SLF001 - as above
    file._source_stamp = stamp  # noqa: SLF001 - as above
    setattr(kernel, _STAMP, stamp)
    return cast(F, kernel)


def _imported(names: dict[str, Any]) -> str:
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
        elif isinstance(value, ModuleType) and not prefix and _holds_kernels(value):
            yield from _taken_in(vars(value), f"{name}.")


def _holds_kernels(module: ModuleType) -> bool:
    return any(isinstance(v, CPUDispatcher) for v in list(vars(module).values()))


def _is_plain(value: object) -> bool:
    if isinstance(value, tuple):
        return all(_is_plain(part) for part in value)
    return isinstance(value, bool | int | float | complex | str)

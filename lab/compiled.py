"""Compile numeric kernels with numba, typed."""

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a function of arrays and scalars; the machine code is cached beside the module.

    No fast-math: results must repeat bit for bit.
    """
    return cast(F, numba.njit(cache=True, nogil=True)(function))

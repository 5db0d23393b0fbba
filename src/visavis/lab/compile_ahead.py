"""Compile kernels before they are called: for types that are written down, in any process.

A kernel is compiled for the types it is called with, so only a call tells for which, or a line like
`visavis.analysis.gaze.looks:_runs(readonly int64[1], int16[1], int64)`. Scalars have numba's names;
arrays are written with their dimensions (`float64[2]`, `float64[1, A]` where not contiguous), named
tuples and the records of an array by the module that has them
(`visavis.lab.geometry:Pose(float64[1], float64[1])`, `…observer.state:MIND_DTYPE[1]`).
"""

import ast
import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numba
import numba.core.types
import numpy as np
from numba.core.errors import NumbaNotImplementedError

from visavis.lab.compiled import MADE

types: Any = numba.core.types  # whose own types know less than they have
SIMULATING: Final = "simulating"
MEASURING: Final = "measuring"


def read_list(path: Path, study: str, phase: str) -> tuple[str, ...]:
    """Return the kernels that a study calls in a phase, those that take longest first.

    A line of the file holds study, phase, seconds and kernel; `#` begins a comment.
    """
    lines = (line.split(" ", 3) for line in path.read_text("utf-8").splitlines())
    return tuple(line[3] for line in lines if line[:2] == [study, phase])


class NotWritable(ValueError):
    """A type for which there is no word here."""


def compile_kernel(line: str) -> None:
    """Compile a kernel for the types in a line, or load it where it is kept.

    Raises:
        ImportError, AttributeError, ValueError: the line names what is not there.
    """
    call = ast.parse(_as_python(line), mode="eval").body
    if not isinstance(call, ast.Call):
        raise ValueError(f"no kernel with its types: {line}")
    kernel: Any = _named(call.func)
    kernel.compile(tuple(_type_of(one) for one in call.args))


def kernels_in_use() -> frozenset[str]:
    """Return a line for every kernel and types that this process has called, compiled or loaded.

    A kernel that was compiled here is followed by those it calls; one that was loaded is not.
    """
    return frozenset(_lines_in_use())


def _lines_in_use() -> Iterator[str]:
    for kernel in MADE:
        function = kernel.py_func
        for signature in kernel.overloads:
            try:
                words = ", ".join(_word_for(one) for one in signature)
            except NotWritable:
                continue
            yield f"{function.__module__}:{function.__qualname__}({words})"


def _as_python(line: str) -> str:
    """Return a line as an expression: `a.b:c` is `a.b.c`, and `readonly x` is `readonly * x`."""
    return line.replace(":", ".").replace("readonly ", "readonly * ")


def _named(node: ast.expr) -> Any:
    """Return what a dotted name stands for; the last part is looked up in a module."""
    module, _, name = ast.unparse(node).rpartition(".")
    return getattr(importlib.import_module(module), name)


def _type_of(node: ast.expr) -> Any:
    if isinstance(node, ast.BinOp):
        return _type_of(node.right).copy(readonly=True)
    if isinstance(node, ast.Subscript):
        # dimensions, and the layout where it is another than C
        index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        layout = ast.unparse(index[1]) if len(index) > 1 else "C"
        return types.Array(_type_of(node.value), ast.literal_eval(index[0]), layout)
    if isinstance(node, ast.Tuple):
        return types.BaseTuple.from_types([_type_of(one) for one in node.elts])
    if isinstance(node, ast.Call):
        return types.BaseTuple.from_types([_type_of(one) for one in node.args], _named(node.func))
    if isinstance(node, ast.Name):
        return getattr(types, node.id)
    return numba.from_dtype(_named(node))


def _word_for(one: Any) -> str:
    if isinstance(one, types.Array):
        layout = "" if one.layout == "C" else f", {one.layout}"
        return f"{'' if one.mutable else 'readonly '}{_word_for(one.dtype)}[{one.ndim}{layout}]"
    if isinstance(one, types.BaseNamedTuple):
        made = one.instance_class
        words = ", ".join(_word_for(part) for part in one.types)
        return f"{made.__module__}:{made.__qualname__}({words})"
    if isinstance(one, types.BaseTuple):
        return f"({''.join(f'{_word_for(part)}, ' for part in one.types)})"
    if isinstance(one, types.Record):
        return _name_of_records(one)
    if getattr(types, str(one), None) == one:
        return str(one)
    raise NotWritable(str(one))


def _is_record_of(records: np.dtype[Any], one: Any) -> bool:
    """Tell whether a type of records is `one`; one that no kernel can have is not."""
    try:
        return bool(numba.from_dtype(records) == one)
    except NumbaNotImplementedError:
        return False


def _name_of_records(one: Any) -> str:
    """Return the name under which a module of ours has these records' type."""
    names = sorted(
        f"{name}:{key}"
        for name, module in list(sys.modules.items())
        if name.startswith("visavis.")
        for key, value in vars(module).items()
        if isinstance(value, np.dtype) and value.names and _is_record_of(value, one)
    )
    if not names:
        raise NotWritable(str(one))
    return names[0]

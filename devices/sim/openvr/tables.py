"""The function tables of OpenVR's interfaces, from the package's own definitions, for C."""

import ctypes
from collections.abc import Callable, Mapping
from typing import Any


class FunctionTables:
    """Our functions that C code calls; `failure` keeps the first error in one of them."""

    def __init__(self, native: Any) -> None:
        self._native = native
        self._keep: list[Any] = []
        self.failure: Exception | None = None

    def fill(self, number: int, table: Any, functions: Mapping[str, Callable[..., Any]]) -> None:
        """Put functions into the table of an interface, by the names of its slots."""
        for slot, (name, prototype) in enumerate(table._fields_):
            if name in functions:
                callback = prototype(self._guard(functions[name], prototype))
                self._keep.append(callback)
                pointer = ctypes.cast(callback, ctypes.c_void_p)
                self._native.visavis_vr_set_function(number, slot, pointer)

    def _guard(self, function: Callable[..., Any], prototype: Any) -> Callable[..., Any]:
        """Store the error of a callback: C cannot pass it on, so it is raised at the end."""

        def call(*args: Any) -> Any:
            try:
                return function(*args)
            except Exception as problem:  # exceptions must not reach C code
                self.failure = self.failure or problem
                return None if prototype._restype_ is None else 0

        return call


def table_header() -> str:
    """Return C definitions of the function tables, from the package's own."""
    import openvr

    lines = []
    for name, table, version in (
        ("SYSTEM", openvr.IVRSystem_FnTable, openvr.IVRSystem_Version),
        ("COMPOSITOR", openvr.IVRCompositor_FnTable, openvr.IVRCompositor_Version),
    ):
        slots = [slot for slot, _ in table._fields_]
        slot_macros = " ".join(f"X({name}, {slot})" for slot in slots)
        lines.append(f"#define {name}_SLOTS(X) {slot_macros}")
        lines.append(f'#define {name}_VERSION "{version}"')
        slot_numbers = ", ".join(f"SLOT_{name}_{slot}" for slot in slots)
        lines.append(f"enum {{ {slot_numbers} }};")
    return "\n".join(lines) + "\n"

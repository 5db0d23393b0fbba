"""What a study file or a script imports.

A study file declares a `Study` (docs/write-a-study.md); a script opens, simulates and analyses
studies (docs/scripts.md). The names stand in `__init__.pyi`, where type checkers find them. Each is
imported when it is first used, so that a command starts without what it does not need.
"""

import ast
import importlib
from pathlib import Path
from typing import Any


def _homes() -> dict[str, tuple[str, str]]:
    """Return the module and the name in it of every public name."""
    listed = ast.parse(Path(__file__).with_name("__init__.pyi").read_text("utf-8"))
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in listed.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


_HOMES = _homes()


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"visavis has no {name!r}; it has {', '.join(__dir__())}")
    module, attribute = _HOMES[name]
    home = importlib.import_module(module)
    if not hasattr(home, attribute):  # a module, such as visavis.analysis.gaze
        importlib.import_module(f"{module}.{attribute}")
    globals()[name] = getattr(home, attribute)
    return globals()[name]


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(_HOMES)

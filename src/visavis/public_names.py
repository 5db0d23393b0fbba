"""Where every public name of Visavis stands: `__init__.pyi` is the one list of them."""

import ast
import importlib
from pathlib import Path
from typing import Any, Final


def _homes() -> dict[str, tuple[str, str]]:
    """Return the module and the name in it of every public name."""
    module = ast.parse(Path(__file__).with_name("__init__.pyi").read_text("utf-8"))
    return {
        alias.asname or alias.name: (node.module or "", alias.name)
        for node in module.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


HOMES: Final = _homes()
"""The module and the name in it of every public name."""
STUDY_ROOMS: Final = ("visavis.study.", "visavis.protocol.", "visavis.people.", "visavis.stimuli.")
"""Where the names stand that study files need; scripts import others by their names."""


def public_object(name: str) -> Any:
    """Import and return what a public name stands for; KeyError for any other name."""
    module, attribute = HOMES[name]
    home = importlib.import_module(module)
    if not hasattr(home, attribute):  # a module, such as visavis.analysis.gaze
        importlib.import_module(f"{module}.{attribute}")
    return getattr(home, attribute)

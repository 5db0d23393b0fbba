"""How often Python looks for objects that only refer to each other."""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Final

NEW_OBJECTS: Final = 50_000
"""Python's own number is 700, with which it looks a hundred times a second."""


@contextmanager
def collecting_seldom() -> Iterator[None]:
    """Look for garbage after more new objects than Python would, in this block.

    For work that makes many objects and keeps them, where a look takes time and finds nothing; not
    for a session with people, in which a longer look would delay a frame.
    """
    thresholds = gc.get_threshold()
    gc.set_threshold(NEW_OBJECTS, *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)


def import_to_stay(name: str) -> ModuleType:
    """Import a module for the rest of the process, and return it.

    Importing makes a million objects that stay: Python does not look for garbage meanwhile, and
    passes over these objects whenever it looks later, which shortens what may delay a frame.
    """
    if name in sys.modules:
        return sys.modules[name]
    was_on = gc.isenabled()
    gc.disable()
    try:
        module = import_module(name)
    finally:
        if was_on:
            gc.enable()
    gc.freeze()
    return module

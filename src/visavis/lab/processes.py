"""Processes of their own, begun from a command, a script, a notebook or a terminal alike.

A process that is spawned imports the main module of the one that spawns it. A script without
`if __name__ == "__main__":` would run again there and spawn in turn. What our processes do stands
in modules, so they leave the main module alone.
"""

import pickle
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from visavis.lab.garbage import import_to_stay


def needs_main(*things: Any) -> bool:
    """Tell whether something that is sent to another process stands in the main module."""
    return b"__main__" in pickle.dumps(things)


@contextmanager
def main_unseen(is_unseen: bool = True) -> Iterator[None]:
    """Begin processes that do not import the main module; with `is_unseen` False they do."""
    main = sys.modules.get("__main__")
    if main is None or not is_unseen:
        yield
        return
    names = ("__spec__", "__file__")
    before = {name: vars(main)[name] for name in names if name in vars(main)}
    main.__spec__ = None
    vars(main).pop("__file__", None)
    try:
        yield
    finally:
        vars(main).update(before)


def begin_worker(module: str) -> None:
    """Begin a process that does what a module's function is sent: import the module first.

    Ctrl-C reaches a terminal's whole group; it ends work by way of the parent alone.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A module that cannot be imported is named by the first job; here it would end the process.
    if module != "__main__":  # which is another module here
        with suppress(ImportError):
            import_to_stay(module)

"""Let several threads measure, and speak to, one simulated body."""

import threading
from typing import Any


class SharedBody:
    """Pass every call on to a body or simulated participant, one at a time.

    A simulator hosted on real sockets measures the body from its own thread while the session
    moves it, shows it scenes and measures its head. All methods of the body exist here; calls are
    made under one lock.
    """

    def __init__(self, body: Any) -> None:
        self._body = body
        self._lock = threading.RLock()

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._body, name)
        if not callable(attribute):
            return attribute
        lock = self._lock

        def alone(*args: Any, **kwargs: Any) -> Any:
            with lock:
                return attribute(*args, **kwargs)

        self.__dict__[name] = alone  # no lookup from now on
        return alone

"""A vendor's library as a message transport: a thread of its own fetches what the library has."""

import threading
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

from visavis.devices.arrivals import Arrivals
from visavis.devices.transports import Exchange, Frames, Message, OnlyListening
from visavis.lab.clock import Clock

JOIN_S = 1.0


class LibraryWire(OnlyListening):
    """What drivers of libraries share; a library says how it opens, answers and is fetched from.

    `remedy` is what to do when it gives nothing, `most` how many messages wait at most.
    """

    def __init__(
        self,
        library_path: str,
        clock: Clock,
        *,
        remedy: str,
        most: int | None = None,
        is_simulated: bool = False,
    ) -> None:
        self.is_simulated = is_simulated
        self._path = library_path
        self._clock = clock
        self._remedy, self._most = remedy, most
        self._library: Any = None
        self._arrivals = Arrivals(most)
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def kind(self) -> str:
        """Name the library."""
        return f"library {self._path}"

    @abstractmethod
    def request(self, frames: Frames, timeout_s: float) -> Exchange:
        """Ask the library something and return its answer."""

    @abstractmethod
    def _fetch(self) -> None:
        """Fetch until `_stopping` is set; runs in the thread."""

    def post(self, frames: Frames) -> None:
        """Call now and hand the answer over with the next data."""
        exchange = self.request(frames, 0.0)
        self._arrivals.add(Message(exchange.t_receive_ns, exchange.frames, exchange.t_send_ns))

    def receive(self, timeout_s: float) -> Sequence[Message]:
        """Return what was fetched; raises DeviceDisconnected while the library gives none."""
        return self._arrivals.take(timeout_s, self._remedy)

    def _begin_to_fetch(self, name: str) -> None:
        self._arrivals = Arrivals(self._most)
        self._stopping.clear()
        self._thread = threading.Thread(target=self._fetch, name=name, daemon=True)
        self._thread.start()

    def _stop_fetching(self) -> None:
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(JOIN_S)
            self._thread = None

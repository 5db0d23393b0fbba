"""What a thread of a library or a network takes in, for a driver that reads when it may."""

import threading
from collections import deque
from collections.abc import Sequence

from visavis.devices.transports import Message
from visavis.lab.errors import DeviceDisconnected


class Arrivals:
    """Messages in the order they came, and why no more come.

    Of more than `most` that nobody takes, the oldest are lost.
    """

    def __init__(self, most: int | None = None) -> None:
        self._something = threading.Condition()
        self._messages: deque[Message] = deque(maxlen=most)
        self._gone = ""

    def add(self, *messages: Message) -> None:
        """Take in messages, and let who waits for them go on, be there none."""
        with self._something:
            self._messages.extend(messages)
            self._something.notify_all()

    def end(self, gone: str) -> None:
        """Say why nothing more comes; "" when it comes again."""
        with self._something:
            self._gone = gone
            self._something.notify_all()

    def take(self, timeout_s: float, remedy: str) -> Sequence[Message]:
        """Return what came, or comes in time; raises DeviceDisconnected when nothing more does."""
        with self._something:
            if not self._messages and not self._gone and timeout_s > 0:
                self._something.wait(timeout_s)
            messages = list(self._messages)
            self._messages.clear()
            reason = self._gone
        if reason and not messages:
            raise DeviceDisconnected(reason, remedy=remedy)
        return messages

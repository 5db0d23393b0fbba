"""Messages that a library's or network thread receives and a driver reads later."""

import threading
from collections import deque
from collections.abc import Sequence

from visavis.devices.transports import Message
from visavis.lab.errors import DeviceDisconnected


class Arrivals:
    """Messages in order of arrival, and the reason why no more come.

    At most `most` messages wait; beyond that the oldest are lost.
    """

    def __init__(self, most: int | None = None) -> None:
        self._something = threading.Condition()
        self._messages: deque[Message] = deque(maxlen=most)
        self._end_reason = ""

    def add(self, *messages: Message) -> None:
        """Add messages, if any, and wake whoever waits for them."""
        with self._something:
            self._messages.extend(messages)
            self._something.notify_all()

    def end(self, reason: str) -> None:
        """Set the reason why nothing more comes; "" when messages come again."""
        with self._something:
            self._end_reason = reason
            self._something.notify_all()

    def take(self, timeout_s: float, remedy: str) -> Sequence[Message]:
        """Return all messages, waiting for a first one; raises DeviceDisconnected when ended."""
        with self._something:
            if not self._messages and not self._end_reason and timeout_s > 0:
                self._something.wait(timeout_s)
            messages = list(self._messages)
            self._messages.clear()
            reason = self._end_reason
        if reason and not messages:
            raise DeviceDisconnected(reason, remedy=remedy)
        return messages

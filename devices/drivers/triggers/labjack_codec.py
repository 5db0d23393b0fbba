"""Low-level function Feedback of LabJack's U3 and U6: eight lines EIO0-7 set at once.

Compared with LabJackPython, which packs the same bytes. Source: U3 User's Guide, 5.2.5.
"""

from collections.abc import Iterator

COMMAND = 0xF8
PORT_STATE_WRITE, PORT_DIRECTION_WRITE = 27, 29
EIO = (0, 0xFF, 0)
"""Write mask of FIO, EIO, CIO."""
HEADER = 6


def feedback(commands: bytes) -> bytes:
    """Return a Feedback packet with both checksums."""
    body = b"\0" + commands  # echo, then the commands
    body += b"\0" * (len(body) % 2)
    total = sum(body) & 0xFFFF
    head = bytes((COMMAND, len(body) // 2, 0, total & 0xFF, total >> 8))
    return bytes((_checksum8(head),)) + head + body


def lines_out() -> bytes:
    """Return the packet that makes EIO outputs, all low."""
    write = bytes((PORT_STATE_WRITE, *EIO, 0, 0, 0))
    return feedback(write + bytes((PORT_DIRECTION_WRITE, *EIO, *EIO)))


def set_lines(code: int) -> bytes:
    """Return the packet that puts a code, 0 to 255, on EIO0-7."""
    return feedback(bytes((PORT_STATE_WRITE, *EIO, 0, code, 0)))


class AnswerReader:
    """Find answers to Feedback, however chunked; `unreadable_count` is of bytes outside of them."""

    def __init__(self) -> None:
        self._rest = b""
        self.unreadable_count = 0

    def feed(self, data: bytes) -> Iterator[int]:
        """Yield the error code of every answer, 0 where it was carried out."""
        self._rest += data
        while len(self._rest) >= HEADER:
            answer_length = _answer(self._rest)
            if answer_length is None:
                self.unreadable_count += 1
                self._rest = self._rest[1:]
            elif len(self._rest) < answer_length:
                return
            else:
                packet, self._rest = self._rest[:answer_length], self._rest[answer_length:]
                total = sum(packet[HEADER:]) & 0xFFFF
                if packet[4] | packet[5] << 8 == total:
                    yield packet[6]
                else:
                    self.unreadable_count += len(packet)


def _answer(data: bytes) -> int | None:
    """Return the length of the answer that begins here; None if none does."""
    if data[1] != COMMAND or data[3] != 0 or not 0 < data[2] <= 29:
        return None
    return HEADER + 2 * data[2] if data[0] == _checksum8(data[1:HEADER]) else None


def _checksum8(data: bytes) -> int:
    total = sum(data)
    total = (total & 0xFF) + (total >> 8)
    return (total & 0xFF) + (total >> 8)

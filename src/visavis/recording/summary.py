"""What a recorder reports about its files, while writing and after closing them."""

from dataclasses import dataclass
from typing import Literal

CloseStatus = Literal["complete", "aborted"]


@dataclass(frozen=True)
class StreamStats:
    """What the operator sees of a stream while it is recorded; `last_t_host_ns` is None before
    data.
    """

    rows: int
    bytes: int
    dropped: int
    last_t_host_ns: int | None


@dataclass(frozen=True)
class StreamSummary:
    """A stream file as it was closed; `closed_cleanly` is False when writing had failed, and
    `sha256` empty until the file was read again.
    """

    name: str
    file: str
    rows: int
    bytes: int
    dropped: int
    first_t_host_ns: int | None
    last_t_host_ns: int | None
    sha256: str
    closed_cleanly: bool


@dataclass(frozen=True)
class JournalSummary:
    """The event journal as it was closed."""

    file: str
    lines: int
    trials: int
    bytes: int
    sha256: str
    closed_cleanly: bool


@dataclass(frozen=True)
class FileSummary:
    """Any other file as it was when its part ended."""

    file: str
    bytes: int
    sha256: str


@dataclass(frozen=True)
class PartSummary:
    """Everything the manifest stores about a closed part."""

    status: CloseStatus
    streams: tuple[StreamSummary, ...]
    journal: JournalSummary
    failure: str = ""

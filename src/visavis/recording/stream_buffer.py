"""Samples of one stream that wait for the disk."""

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.recording.columns import BatchEncoder
from visavis.recording.durable import AppendOnlyFile
from visavis.recording.summary import StreamSummary


class Rows:
    """Room for rows of one stream in arrival order."""

    def __init__(self, schema: StreamSchema, capacity: int) -> None:
        self.capacity = capacity
        self.count = 0
        self.stamps: npt.NDArray[np.int64] = np.zeros((3, capacity), dtype=np.int64)
        self.seq, self.t_device_ns, self.t_host_ns = self.stamps
        self.values: npt.NDArray[np.void] = np.zeros(capacity, dtype=schema.dtype)
        # Copying rows as opaque bytes is five times as fast as field by field.
        self.opaque = self.values.view(f"V{schema.dtype.itemsize}")


@dataclass
class OpenStream:
    """A declared stream: its file, the rows being filled, and counts.

    `spare` is what the writer thread writes from while `rows` fills; None without a thread, and
    then batches are `waiting_batches` until they are written together.
    """

    schema: StreamSchema
    file: AppendOnlyFile
    encoder: BatchEncoder
    rows: Rows
    spare: Rows | None
    lock: threading.Lock = field(default_factory=threading.Lock)
    opaque: Any = None
    most_rows: int = 0
    waiting_batches: list[tuple[bytes, bytes, bytes, bytes]] = field(default_factory=list)
    held_rows: int = 0
    oldest_t_host_ns: int = 0
    first_t_host_ns: int | None = None
    last_t_host_ns: int | None = None
    rows_accepted: int = 0
    rows_written: int = 0
    n_dropped: int = 0

    def copy_in(self, batch: SampleBatch, n: int, latest_ns: int) -> bool:
        """Copy n samples into `rows`; False, counting them as dropped, where there is no room.

        Room is made for up to `most_rows`: after a pause all that a device kept comes at once.
        """
        rows = self.rows
        start = rows.count
        end = start + n
        if end > rows.capacity:
            if end > self.most_rows:
                self.n_dropped += n
                return False
            rows = self._enlarge(min(max(end, 2 * rows.capacity), self.most_rows))
        rows.seq[start:end] = batch.seq
        rows.t_device_ns[start:end] = batch.t_device_ns
        rows.t_host_ns[start:end] = batch.t_host_ns
        rows.opaque[start:end] = batch.values.view(self.opaque)
        rows.count = end
        self._note(batch, n, latest_ns)
        return True

    def hold(self, batch: SampleBatch, n: int, latest_ns: int) -> None:
        """Keep n samples until they are written together."""
        if not self.waiting_batches:
            self.oldest_t_host_ns = int(batch.t_host_ns[0])
        # Bytes are the quickest copy of a row or two, and are joined before they are written.
        self.waiting_batches.append(
            (
                batch.seq.tobytes(),
                batch.t_device_ns.tobytes(),
                batch.t_host_ns.tobytes(),
                batch.values.tobytes(),
            )
        )
        self.held_rows += n
        self._note(batch, n, latest_ns)

    def join_held(self) -> Rows:
        """Return all waiting batches as rows, and empty the list."""
        batches, n = self.waiting_batches, self.held_rows
        if n > self.rows.capacity:
            self.rows = Rows(self.schema, n)
        rows = self.rows
        seq, t_device_ns, t_host_ns, values = (
            b"".join(column) for column in zip(*batches, strict=True)
        )
        rows.seq[:n] = np.frombuffer(seq, np.int64)
        rows.t_device_ns[:n] = np.frombuffer(t_device_ns, np.int64)
        rows.t_host_ns[:n] = np.frombuffer(t_host_ns, np.int64)
        rows.opaque[:n] = np.frombuffer(values, self.opaque)
        rows.count = n
        batches.clear()
        self.held_rows = 0
        return rows

    def summary(self, *, is_clean: bool) -> StreamSummary:
        """Return the summary of the closed file for the manifest."""
        return StreamSummary(
            name=self.schema.name,
            file=self.file.path.name,
            rows=self.rows_written,
            bytes=self.file.size,
            dropped=self.n_dropped,
            first_t_host_ns=self.first_t_host_ns,
            last_t_host_ns=self.last_t_host_ns,
            sha256=self.file.sha256() if is_clean else "",
            closed_cleanly=is_clean,
        )

    def _enlarge(self, capacity: int) -> Rows:
        old, rows = self.rows, Rows(self.schema, capacity)
        n = rows.count = old.count
        rows.stamps[:, :n] = old.stamps[:, :n]
        rows.opaque[:n] = old.opaque[:n]
        self.rows = rows
        return rows

    def _note(self, batch: SampleBatch, n: int, latest_ns: int) -> None:
        self.rows_accepted += n
        self.last_t_host_ns = latest_ns
        if self.first_t_host_ns is None:
            self.first_t_host_ns = int(batch.t_host_ns[0])

"""Write one part of a session: a file per stream and the event journal."""

import base64
import re
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import RecordingError
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.recording.columns import END_OF_STREAM, FORMAT_VERSION, BatchEncoder
from visavis.recording.durable import AppendOnlyFile, sync_folder
from visavis.recording.journal import JOURNAL_NAME, encode_line
from visavis.recording.stream_buffer import OpenStream, Rows
from visavis.recording.summary import (
    CloseStatus,
    JournalSummary,
    PartSummary,
    StreamStats,
)

__all__ = ["REAL_TIME_BATCH_NS", "VIRTUAL_TIME_BATCH_NS", "CloseStatus", "Recorder"]

REAL_TIME_BATCH_NS = NS_PER_S // 10
VIRTUAL_TIME_BATCH_NS = 4 * NS_PER_S
_SYNC_EVERY_NS = NS_PER_S
_STREAM_NAME = re.compile(r"[A-Za-z0-9_-]+")
_QUEUE_S = 10.0
_MIN_QUEUE_ROWS = 2048
_QUEUE_GROWS = 16
"""How many times its usual length a queue may reach, after a pause of the computer."""
_MAX_QUEUED_EVENTS = 100_000


class Recorder:
    """Own the files of one part of a session.

    Thread-safe. `threaded`: a writer thread owns the files, `append` only copies rows into a
    bounded queue, and data are synced every second. Otherwise (virtual clock) the same code
    writes inline whenever a stream has gathered `max_batch_ns` of session time, so that files
    depend on the data alone; without `awaits_disk` it waits for the disk at the end only, for a
    session that can be made again. The first failure to write is raised by every later call; what
    was acknowledged before it stays readable.
    """

    def __init__(
        self,
        part_dir: Path,
        clock: Clock,
        *,
        threaded: bool,
        max_batch_ns: int,
        is_simulated: bool,
        awaits_disk: bool = True,
    ) -> None:
        if threaded and clock.is_virtual:
            raise RecordingError(
                "a virtual clock cannot pace a writer thread; record with threaded=False"
            )
        self._dir = part_dir
        self._clock = clock
        self._max_batch_ns = max_batch_ns
        self._awaits_disk = awaits_disk
        self._is_simulated = is_simulated
        self._streams: dict[str, OpenStream] = {}
        self._failure: RecordingError | None = None
        self._failure_reported = False
        self._summary: PartSummary | None = None
        self._journal = AppendOnlyFile(part_dir / JOURNAL_NAME)
        self._lines: list[bytes] = []
        self._lines_written = 0
        self._trials = 0
        self._oldest_line_ns = 0
        self._journal_lock = threading.Lock()
        self._write_lines([self._header_line()])
        self._journal.sync()
        sync_folder(part_dir)
        self._last_sync_ns = clock.now_ns()
        self._wake = threading.Condition()
        self._sync_wanted = 0
        self._sync_done = 0
        self._stopping = False
        self._is_resting = False
        self._thread: threading.Thread | None = None
        if threaded:
            self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
            self._thread.start()

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if self._summary is None:
            self.close("complete" if error is None else "aborted")

    def declare(self, schema: StreamSchema) -> None:
        """Create the file of a stream; every stream is declared once, before its first batch."""
        self._raise_failure()
        if schema.name in self._streams:
            raise RecordingError(
                f"stream {schema.name!r} is declared already in {self._dir}; "
                "give every device its own stream name"
            )
        if not _STREAM_NAME.fullmatch(schema.name):
            raise RecordingError(
                f"stream name {schema.name!r} cannot name a file; use letters, digits, - and _"
            )
        threaded = self._thread is not None
        span_s = _QUEUE_S if threaded else 2 * self._max_batch_ns / NS_PER_S
        capacity = max(int(schema.nominal_rate_hz * span_s) + 64, _MIN_QUEUE_ROWS)
        encoder = BatchEncoder(schema, is_simulated=self._is_simulated)
        file = AppendOnlyFile(self._dir / f"{schema.name}.arrows")
        self._guard(file.write, encoder.header)
        self._guard(file.sync)
        sync_folder(self._dir)
        rows = Rows(schema, capacity)
        spare = Rows(schema, capacity) if threaded else None
        self._streams[schema.name] = OpenStream(
            schema,
            file,
            encoder,
            rows,
            spare,
            opaque=rows.opaque.dtype,
            most_rows=capacity * _QUEUE_GROWS,
        )
        # A second copy of the header, so that damage to the file's first bytes costs nothing. The
        # stream is of this part already, so that a disk that refuses this line leaves no stranger.
        copy = base64.b64encode(encoder.header).decode()
        self._add_line({"kind": "stream", "name": schema.name, "t_ns": 0, "header": copy})
        if threaded:
            self.checkpoint()  # no event precedes samples of other streams that still wait
        else:
            self._guard(self._write_pending_lines)

    def append(self, batch: SampleBatch) -> None:
        """Take the samples of one batch; copies them and never waits for the disk.

        Raises RecordingError when the stream is not declared, when writing has failed, or when
        the writer is so far behind that these samples were dropped (they are counted).
        """
        stream = self._streams.get(batch.schema.name)
        if stream is None or self._failure is not None or self._summary is not None:
            self._refuse(batch.schema.name)
            return
        if stream.schema is not batch.schema and stream.schema != batch.schema:
            raise RecordingError(
                f"stream {batch.schema.name!r} was declared with other fields; "
                "a stream keeps one schema for the whole session"
            )
        n = batch.seq.shape[0]
        if n == 0:
            return
        latest = int(batch.t_host_ns[n - 1])
        if self._thread is None:
            self._hold(stream, batch, n, latest)
            return
        with stream.lock:
            if not stream.copy_in(batch, n, latest):
                raise RecordingError(
                    f"stream {stream.schema.name!r}: the disk is behind by {stream.rows.count} "
                    f"samples, {n} were dropped ({stream.n_dropped} in all); end the trial and "
                    "check the disk"
                )

    def event(self, name: str, t_ns: int, /, **payload: Any) -> None:
        """Note an event; it is written with the next batch."""
        self._add_line({"kind": "event", "name": name, "t_ns": int(t_ns), "payload": payload})

    def trial(self, row: Mapping[str, Any]) -> None:
        """Write a trial's result row.

        When this returns, the row and every sample and event before it are on the disk.
        """
        self._add_line({"kind": "trial", "t_ns": self._clock.now_ns(), "row": row})
        self._trials += 1
        self.checkpoint()

    def checkpoint(self, timeout_s: float = 30.0) -> None:
        """Return once everything appended so far is on the disk; RecordingError after timeout.

        Without `awaits_disk` it is handed to the system, which a killed process does not undo.
        """
        self._raise_failure()
        if self._thread is None:
            self._guard(self._write_all_pending, self._awaits_disk)
            return
        with self._wake:
            self._sync_wanted += 1
            ticket = self._sync_wanted
            self._wake.notify_all()
            is_synced = self._wake.wait_for(
                lambda: self._sync_done >= ticket or self._failure is not None, timeout_s
            )
        self._raise_failure()
        if not is_synced:
            raise RecordingError(
                f"{self._dir}: the disk did not take the data within {timeout_s:g} s; "
                "check the disk before going on"
            )

    def stats(self) -> dict[str, StreamStats]:
        """Return counts per stream for the operator's screen."""
        return {
            name: StreamStats(s.rows_accepted, s.file.size, s.n_dropped, s.last_t_host_ns)
            for name, s in self._streams.items()
        }

    def close(self, status: CloseStatus) -> PartSummary:
        """Close every file and return this part's summary for the manifest; idempotent.

        Files are always closed. A failure that no earlier call has raised is raised here; one that
        was raised before is named in the summary.
        """
        if self._summary is not None:
            return self._summary
        self._stop_thread()
        if self._failure is None:
            self._guard_quietly(self._finish)
        failure = self._failure
        clean = failure is None
        streams = tuple(stream.summary(is_clean=clean) for stream in self._streams.values())
        journal = JournalSummary(
            file=JOURNAL_NAME,
            lines=self._lines_written,
            trials=self._trials,
            bytes=self._journal.size,
            sha256=self._journal.sha256() if clean else "",
            closed_cleanly=clean,
        )
        self._summary = PartSummary(
            status if clean else "aborted", streams, journal, str(failure) if failure else ""
        )
        for stream in self._streams.values():
            stream.file.close()
        self._journal.close()
        if failure is not None and not self._failure_reported:
            raise failure
        return self._summary

    # ---- private --------------------------------------------------------------------------

    def _header_line(self) -> bytes:
        return encode_line(
            {"kind": "header", "format": FORMAT_VERSION, "is_simulated": self._is_simulated}
        )

    def _raise_failure(self) -> None:
        if self._failure is not None:
            self._failure_reported = True
            raise self._failure
        if self._summary is not None:
            raise RecordingError(f"{self._dir} is closed; begin a new part to record more")

    def _refuse(self, name: str) -> None:
        self._raise_failure()
        raise RecordingError(
            f"stream {name!r} was not declared in {self._dir}; declare every stream of a device "
            "before starting it"
        )

    def _hold(self, stream: OpenStream, batch: SampleBatch, n: int, latest_ns: int) -> None:
        """Keep a batch; write what is held once it spans long enough, or is too much.

        What is written together ends with the same row however samples were delivered.
        """
        if stream.waiting_batches and stream.held_rows + n > stream.rows.capacity:
            self._guard(self._write_held, stream)
        arrivals_ns, max_batch_ns = batch.t_host_ns, self._max_batch_ns
        if n > 1:
            is_held = bool(stream.waiting_batches)
            due_ns = (stream.oldest_t_host_ns if is_held else int(arrivals_ns[0])) + max_batch_ns
            end = int(np.argmax(arrivals_ns >= due_ns)) + 1 if arrivals_ns.max() >= due_ns else n
            if end < n:
                self._hold(stream, batch.part(0, end), end, int(arrivals_ns[end - 1]))
                self._hold(stream, batch.part(end, n), n - end, latest_ns)
                return
        stream.hold(batch, n, latest_ns)
        if latest_ns - stream.oldest_t_host_ns >= max_batch_ns:
            self._guard(self._write_held, stream)

    def _write_held(self, stream: OpenStream) -> None:
        rows = stream.join_held()
        self._write_rows(stream, rows)
        rows.count = 0

    def _add_line(self, entry: Mapping[str, Any]) -> None:
        self._raise_failure()
        try:
            line = encode_line(entry)
        except TypeError as error:
            raise RecordingError(
                f"{entry['kind']} {entry.get('name', '')!r}: {error}; pass texts, numbers, "
                "flags or None"
            ) from error
        with self._journal_lock:
            if len(self._lines) >= _MAX_QUEUED_EVENTS:
                raise RecordingError(
                    f"{self._journal.path}: {_MAX_QUEUED_EVENTS} events wait for the disk; "
                    "check the disk before going on"
                )
            is_first = not self._lines
            if is_first:
                self._oldest_line_ns = entry["t_ns"]
            self._lines.append(line)
            is_old = entry["t_ns"] - self._oldest_line_ns >= self._max_batch_ns
            due = is_old and entry["kind"] != "trial"  # whose samples come first
        if self._thread is None:
            if due:
                self._guard(self._write_pending_lines)
        elif is_first:
            with self._wake:
                if self._is_resting:
                    self._wake.notify_all()

    def _guard(self, action: Callable[..., None], *args: Any) -> None:
        """Run an action on the files; the first failure is stored and raised."""
        self._guard_quietly(action, *args)
        if self._failure is not None:
            self._raise_failure()

    def _guard_quietly(self, action: Callable[..., None], *args: Any) -> None:
        try:
            action(*args)
        except RecordingError as error:
            self._failure = self._failure or error

    def _write_rows(self, stream: OpenStream, rows: Rows) -> None:
        n = rows.count
        message = stream.encoder.encode(rows.stamps[:, :n], rows.values[:n], stream.rows_written)
        stream.file.write(message)
        stream.rows_written += n

    def _write_lines(self, lines: list[bytes]) -> None:
        if lines:
            self._journal.write(b"".join(lines))
            self._lines_written += len(lines)

    def _take_lines(self) -> list[bytes]:
        with self._journal_lock:
            lines, self._lines = self._lines, []
        return lines

    def _write_pending_lines(self) -> None:
        self._write_lines(self._take_lines())

    def _write_all_pending(self, sync: bool) -> None:
        """Write what waits; a trial row never precedes its samples.

        Lines are taken before the samples and written after them, because more of both may
        arrive in between.
        """
        lines = self._take_lines()
        for stream in tuple(self._streams.values()):
            with stream.lock:
                rows = stream.rows
                if stream.spare is None:
                    if stream.waiting_batches:
                        self._write_held(stream)
                    continue
                if rows.count == 0:
                    continue
                stream.rows, stream.spare = stream.spare, rows
            self._write_rows(stream, rows)
            rows.count = 0
        if sync:
            for stream in tuple(self._streams.values()):
                stream.file.sync()
        self._write_lines(lines)
        if sync:
            self._journal.sync()

    def _finish(self) -> None:
        self._write_all_pending(True)
        for stream in self._streams.values():
            stream.file.write(END_OF_STREAM)
            stream.file.sync()
        self._write_lines([encode_line({"kind": "end", "lines": self._lines_written + 1})])
        self._journal.sync()

    def _run(self) -> None:
        """Write on the writer thread until stopped or failed."""
        period_s = self._max_batch_ns / NS_PER_S
        while True:
            with self._wake:
                # Of hundreds of served sessions most wait for somebody who thinks.
                if self._is_settled() and self._has_nothing_to_write():
                    self._is_resting = True
                    self._wake.wait()
                    self._is_resting = False
                if self._is_settled():
                    self._wake.wait(period_s)
                stopping, ticket = self._stopping, self._sync_wanted
            now_ns = self._clock.now_ns()
            sync = ticket > self._sync_done or now_ns - self._last_sync_ns >= _SYNC_EVERY_NS
            try:
                self._guard_quietly(self._write_all_pending, sync)
            except Exception as error:  # top of the thread: the session must know of it
                self._failure = RecordingError(
                    f"{self._dir}: the writer stopped ({error!r}); end the session and resume it"
                )
            if sync:
                self._last_sync_ns = now_ns
            with self._wake:
                self._sync_done = ticket
                self._wake.notify_all()
            if stopping or self._failure is not None:
                return

    def _is_settled(self) -> bool:
        return not self._stopping and self._sync_wanted == self._sync_done

    def _has_nothing_to_write(self) -> bool:
        """Tell whether no stream runs, and every line is on the disk."""
        return not self._streams and not self._lines and not self._journal.needs_sync

    def _stop_thread(self) -> None:
        if self._thread is not None:
            with self._wake:
                self._stopping = True
                self._wake.notify_all()
            self._thread.join()

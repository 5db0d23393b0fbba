"""The streams of a display: the head as foreseen and as measured, the timing of each frame."""

import math
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import FRAME_TIMING, HEAD, HEAD_MEASURED, DeviceState, Health, Sink
from visavis.devices.meter import StreamMeter
from visavis.lab.frame import FrameInfo
from visavis.lab.schema import SampleBatch, StreamSchema

HEAD_ROW = struct.Struct("<3f4f?")
"""A row of `HEAD.dtype`."""


class FrameStreams:
    """Rows of `HEAD`, `FRAME_TIMING` and, from a headset, `HEAD_MEASURED` at a display's rate.

    They are `pending` until they are delivered.
    """

    def __init__(self, rate_hz: float) -> None:
        self.head = replace(HEAD, nominal_rate_hz=rate_hz)
        self.timing = replace(FRAME_TIMING, nominal_rate_hz=rate_hz)
        self.measured = replace(HEAD_MEASURED, nominal_rate_hz=rate_hz)
        self.pending: deque[SampleBatch] = deque()
        self.begin()

    def begin(self) -> None:
        """Count rows from 0, and drop the pending ones."""
        self.pending.clear()
        self._meter = StreamMeter(self.head.nominal_rate_hz)
        self._head_seq = self._timing_seq = self._measured_seq = self._other_rows = 0

    def add_head(self, row: bytes, t_device_ns: int, t_host_ns: int) -> None:
        """Hold a row of `HEAD`, packed by `HEAD_ROW`, that describes the head at `t_device_ns`."""
        self._hold(self.head, self._head_seq, t_device_ns, t_host_ns, row)
        self._head_seq += 1

    def add_heads(self, rows: bytes, t_ns: npt.NDArray[np.int64]) -> None:
        """Hold n rows of `HEAD` of frames that have passed, each of a head at its own time."""
        seq = np.arange(self._head_seq, self._head_seq + len(t_ns))
        self._head_seq += len(t_ns)
        values = np.frombuffer(rows, self.head.dtype)
        self.pending.append(SampleBatch(self.head, seq, t_ns, t_ns, values))

    def add_measured(self, row: bytes, t_device_ns: int, t_host_ns: int) -> None:
        """Hold a row of `HEAD_MEASURED`, packed by `HEAD_ROW`."""
        self._hold(self.measured, self._measured_seq, t_device_ns, t_host_ns, row)
        self._measured_seq += 1

    def timing_of(self, frame: FrameInfo, submitted_ns: int) -> npt.NDArray[np.void]:
        """Return the timing row (1,) of a frame drawn for the head added last."""
        return self.timings_of([frame], submitted_ns)

    def timings_of(self, frames: Sequence[FrameInfo], submitted_ns: int) -> npt.NDArray[np.void]:
        """Return the timing rows (n,) of frames drawn one after another, of which nothing but the
        first was submitted, for the head added last and those that come.
        """
        values = np.zeros(len(frames), self.timing.dtype)
        values["frame"] = [frame.index for frame in frames]
        values["pose_seq"] = np.arange(len(frames)) + (self._head_seq - 1)
        values["predicted_display_ns"] = [frame.predicted_display_ns for frame in frames]
        values["t_submitted_ns"] = -1
        values["t_submitted_ns"][0] = submitted_ns
        values["skipped"] = [frame.dropped for frame in frames]
        values["render_gpu_ms"] = math.nan
        return values

    def add_timing(self, values: npt.NDArray[np.void], t_device_ns: int, t_host_ns: int) -> None:
        """Hold a row (1,) of `FRAME_TIMING`."""
        self._hold(self.timing, self._timing_seq, t_device_ns, t_host_ns, values.tobytes())
        self._timing_seq += 1

    def add_timings(self, values: npt.NDArray[np.void], t_ns: npt.NDArray[np.int64]) -> None:
        """Hold n rows of `FRAME_TIMING` of frames that were shown at these times."""
        seq = np.arange(self._timing_seq, self._timing_seq + len(t_ns))
        self._timing_seq += len(t_ns)
        self.pending.append(SampleBatch(self.timing, seq, t_ns, t_ns, values))

    def deliver(self, sink: Sink | None) -> int:
        """Pass the pending rows to the sink, if there is one; return the number of rows."""
        row_count = 0
        while self.pending and sink is not None:
            batch = self.pending.popleft()
            if batch.schema is self.head:
                self._meter.update(batch.t_device_ns.tolist(), int(batch.t_host_ns[-1]))
            else:
                self._other_rows += len(batch)
            sink(batch)
            row_count += len(batch)
        return row_count

    def health(self, state: DeviceState, now_ns: int) -> Health:
        """Report the rows of all streams; rate and gaps are the head's (dropped frames: holes)."""
        health = self._meter.health(state, now_ns)
        return replace(health, received=health.received + self._other_rows)

    def _hold(
        self, schema: StreamSchema, seq: int, t_device_ns: int, t_host_ns: int, row: bytes
    ) -> None:
        stamps = np.array([seq, t_device_ns, t_host_ns], np.int64)
        values = np.frombuffer(row, schema.dtype)
        self.pending.append(SampleBatch(schema, stamps[0:1], stamps[1:2], stamps[2:3], values))

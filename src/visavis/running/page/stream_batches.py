"""Batches of samples from a page in a headset: checked at the door, written as a lab's streams."""

import base64
import binascii
import hashlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.devices.streams import (
    FRAME_TIMING,
    HEAD,
    NO_DEVICE_TIME,
    POINTER,
    RESPONSES,
    body_schema,
)
from visavis.lab.clock import NS_PER_MS
from visavis.lab.schema import Field, SampleBatch, StreamSchema, empty_values
from visavis.recording.writer import Recorder
from visavis.running.page.steps import PageError, count, number
from visavis.running.page.streams import (
    COLUMNS,
    CONTROLS,
    HAND_JOINTS,
    HAPPENINGS,
    MAX_RATE_HZ,
    MAX_ROWS,
)

MAX_FAR_M: Final = 100.0
"""How far from where somebody entered a head or a hand may be."""
MAX_TILT: Final = 1e-3
"""By how much the length of a unit quaternion may differ from 1."""
MAX_DETAIL: Final = 200
CLOSED_MS: Final = 1.0
"""How much later than its batch was closed a row may be: what float32 rounds off, and more."""
PAGE_FRAME_TIMING: Final = StreamSchema(
    "frame_timing",
    (
        *FRAME_TIMING.fields,
        Field("xr_ns", "i8", "ns", description="time of its callback, by the browser's XR clock"),
        Field("predicted_xr_ns", "i8", "ns", description="predictedDisplayTime, by the same clock"),
        Field("own_ms", "f4", "ms", description="the page's work; NaN: the frame was left out"),
        Field("drawn", "?", "", description="the page drew something"),
    ),
    FRAME_TIMING.nominal_rate_hz,
)
"""The timing of a page's frames; of what a runtime alone knows nothing is known."""
SCHEMAS: Final[Mapping[str, StreamSchema]] = {
    "head": HEAD,
    "frame_timing": PAGE_FRAME_TIMING,
    "pointer": POINTER,
    "responses": RESPONSES,
    "hands": body_schema(HAND_JOINTS, 0.0, "hands"),
}

Rows = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PageBatch:
    """A batch as a page sent it: `rows` (n, columns) after `t0_ms` of the page's clock.

    `xr0_ms` is what times of the headset's browser count from; NaN where the stream has none.
    `rate_hz` is 0 where the browser does not say it.
    """

    stream: str
    seq0: int
    t0_ms: float
    rows: Rows
    digest: str
    xr0_ms: float = np.nan
    rate_hz: float = 0.0

    @property
    def end(self) -> int:
        """The number of the row that follows it."""
        return self.seq0 + len(self.rows)

    @property
    def journaled(self) -> dict[str, Any]:
        """What the journal says of it, beside its number and times."""
        return {
            "stream": self.stream,
            "seq0": self.seq0,
            "rows": len(self.rows),
            "t0_ms": self.t0_ms,
            "digest": self.digest,
        }


def read_batch(event: Mapping[str, Any], streams: Collection[str] = tuple(COLUMNS)) -> PageBatch:
    """Read a batch of samples of one of some streams; anything in it may be forged.

    Raises:
        PageError: it is none, or holds what no headset measures.
    """
    stream = event.get("stream")
    if not isinstance(stream, str) or stream not in streams:
        raise PageError(f"there is no stream {str(stream)[:40]!r}")
    width, n = len(COLUMNS[stream]), count(event.get("rows"), "rows")
    seq0, t0_ms = count(event.get("seq0"), "seq0"), number(event.get("t0_ms"), "t0_ms")
    if not 1 <= n <= MAX_ROWS:
        raise PageError(f"{stream}: {n} rows; a batch has 1 to {MAX_ROWS}")
    data = event.get("data")
    try:
        content = base64.b64decode(data if isinstance(data, str) else "", validate=True)
    except (binascii.Error, ValueError) as error:
        raise PageError(f"{stream}: its data are not base64") from error
    if len(content) != 4 * n * width:
        raise PageError(f"{stream}: {n} rows of {width} numbers are not {len(content)} bytes")
    rows = np.frombuffer(content, "<f4").reshape(n, width).astype(np.float64)
    last_ms = number(event.get("at_ms"), "at_ms") - t0_ms + CLOSED_MS
    times_ms = rows[:, 0]
    if not (times_ms[0] >= 0 and times_ms[-1] <= last_ms and (np.diff(times_ms) >= 0).all()):
        raise PageError(f"{stream}: its rows do not follow one another up to at_ms")
    CHECKS[stream](stream, rows)
    has_xr = stream == "frame_timing"
    rate_hz = event.get("rate_hz")
    if rate_hz is not None and not 0 < number(rate_hz, "rate_hz") <= MAX_RATE_HZ:
        raise PageError(f"{stream}: {rate_hz} Hz is no headset's rate")
    return PageBatch(
        stream,
        seq0,
        t0_ms,
        rows,
        hashlib.sha256(content).hexdigest()[:16],
        number(event.get("xr0_ms"), "xr0_ms") if has_xr else np.nan,
        float(rate_hz or 0.0),
    )


def check_happening(event: Mapping[str, Any]) -> None:
    """Refuse what cannot happen around a headset.

    Raises:
        PageError: saying what is wrong.
    """
    if event.get("what") not in HAPPENINGS:
        raise PageError(f"around a headset nothing happens like {str(event.get('what'))[:40]!r}")
    detail = event.get("detail", "")
    if not isinstance(detail, str) or len(detail) > MAX_DETAIL:
        raise PageError(f"a detail is a text of at most {MAX_DETAIL} characters")


@dataclass
class PageStreams:
    """Write a page's batches into the streams of a recording, each row once.

    `next_rows` are the numbers that come next by what was acknowledged, `rows_on_disk` by what
    earlier parts hold: a part that broke off may hold rows whose acknowledgement never left.
    """

    recorder: Recorder
    rows_on_disk: Mapping[str, int] = field(default_factory=dict)
    next_rows: dict[str, int] = field(default_factory=dict)
    _schemas: dict[str, StreamSchema] = field(default_factory=dict)
    _latest_ns: dict[str, int] = field(default_factory=dict)

    @property
    def going_on(self) -> dict[str, int]:
        """From which number a page goes on in each stream that has any."""
        names = self.rows_on_disk.keys() | self.next_rows.keys()
        pairs = ((n, self.rows_on_disk.get(n, 0), self.next_rows.get(n, 0)) for n in sorted(names))
        return {name: max(on_disk, acknowledged) for name, on_disk, acknowledged in pairs}

    def check_number(self, batch: PageBatch) -> None:
        """Refuse a batch whose numbers go back.

        Raises:
            PageError: saying where the stream is.
        """
        if batch.seq0 < self.next_rows.get(batch.stream, 0):
            raise PageError(
                f"{batch.stream}: row {batch.seq0} came after {self.next_rows[batch.stream] - 1}"
            )

    def has_hole_before(self, batch: PageBatch) -> bool:
        """Tell whether rows are missing between a batch and the one before it."""
        return batch.seq0 > self.going_on.get(batch.stream, batch.seq0)

    def write(self, batch: PageBatch, t_ns_of: Callable[[float], int], now_ns: int) -> None:
        """Hand a batch's rows to the recorder, dated by the page's clock.

        `t_ns_of` places that clock in session time, `now_ns` is when the batch came: no row is
        later, and none earlier than the one before it.
        """
        known_rows = max(0, self.rows_on_disk.get(batch.stream, 0) - batch.seq0)
        n = len(batch.rows)
        if known_rows < n:
            at_ms = batch.t0_ms + batch.rows[:, 0]
            shift_ns = t_ns_of(batch.t0_ms) - round(batch.t0_ms * NS_PER_MS)
            device_ns = np.rint(at_ms * NS_PER_MS).astype(np.int64)
            host_ns = np.minimum(device_ns + shift_ns, now_ns)
            host_ns = np.maximum(host_ns, self._latest_ns.get(batch.stream, host_ns[0]))
            self._latest_ns[batch.stream] = int(host_ns[-1])
            rows = slice(known_rows, n)
            schema = self._schema_of(batch)
            seq = np.arange(batch.seq0, batch.end, dtype=np.int64)
            values = VALUES[batch.stream](schema, batch, seq, host_ns)
            self.recorder.append(
                SampleBatch(schema, seq[rows], device_ns[rows], host_ns[rows], values[rows])
            )
        self.note(batch.stream, batch.end)

    def note(self, stream: str, end: int) -> None:
        """Note that rows of a stream are acknowledged up to a number."""
        self.next_rows[stream] = end

    def _schema_of(self, batch: PageBatch) -> StreamSchema:
        """Return the stream of a batch, declared with the rate of its headset."""
        if batch.stream not in self._schemas:
            schema = SCHEMAS[batch.stream]
            if schema.nominal_rate_hz:
                schema = replace(schema, nominal_rate_hz=batch.rate_hz)
            self.recorder.declare(schema)
            self._schemas[batch.stream] = schema
        return self._schemas[batch.stream]


# ---- what rows may hold ----------------------------------------------------------------------


def _check_poses(stream: str, poses: Rows) -> None:
    """Refuse rows of x y z, w x y z, valid that are no poses; unknown ones are NaN and invalid."""
    values, valid = poses[:, :7], poses[:, 7]
    is_unknown = np.isnan(values).all(axis=1)
    if not np.isin(valid, (0, 1)).all() or valid[is_unknown].any():
        raise PageError(f"{stream}: valid is 1, or 0 where a pose is unknown")
    whole = values[~is_unknown]
    if not (np.abs(whole[:, :3]) <= MAX_FAR_M).all():
        raise PageError(f"{stream}: a position is not within {MAX_FAR_M:g} m")
    if not (np.abs(np.linalg.norm(whole[:, 3:], axis=1) - 1) <= MAX_TILT).all():
        raise PageError(f"{stream}: an orientation is no unit quaternion")


def _check_head(stream: str, rows: Rows) -> None:
    _check_poses(stream, rows[:, 1:])


def _check_pointer(stream: str, rows: Rows) -> None:
    if not np.isin(rows[:, 1], (0, 1)).all():
        raise PageError(f"{stream}: a hand is 0 or 1")
    _check_poses(stream, rows[:, 2:])


def _check_hands(stream: str, rows: Rows) -> None:
    _check_poses(stream, rows[:, 1:].reshape(-1, 8))


def _check_responses(stream: str, rows: Rows) -> None:
    if not np.isin(rows[:, 1], np.arange(len(CONTROLS))).all():
        raise PageError(f"{stream}: a control is 0 to {len(CONTROLS) - 1}")
    if not (np.abs(rows[:, 2]) <= 1).all():
        raise PageError(f"{stream}: a control has a value from -1 to 1")


def _check_frames(stream: str, rows: Rows) -> None:
    times_ms, own_ms, skipped, drawn = rows[:, 1:4], rows[:, 3], rows[:, 4], rows[:, 5]
    if np.isinf(rows).any() or (np.abs(times_ms) > 1e9).any() or (own_ms < 0).any():
        raise PageError(f"{stream}: a time is none")
    if not ((skipped >= 0) & (skipped == np.floor(skipped)) & (skipped < 2**24)).all():
        raise PageError(f"{stream}: skipped counts nothing")
    if not np.isin(drawn, (0, 1)).all():
        raise PageError(f"{stream}: drawn is 0 or 1")


CHECKS: Final[Mapping[str, Callable[[str, Rows], None]]] = {
    "head": _check_head,
    "frame_timing": _check_frames,
    "pointer": _check_pointer,
    "responses": _check_responses,
    "hands": _check_hands,
}

# ---- what is written -------------------------------------------------------------------------

Values = npt.NDArray[np.void]
Times = npt.NDArray[np.int64]


def _pose_values(schema: StreamSchema, poses: Rows) -> Values:
    values = empty_values(schema, len(poses))
    shape = (-1, *schema.fields[-1].shape)
    values["position_m"] = poses[..., :3].reshape(*shape, 3)
    values["orientation_wxyz"] = poses[..., 3:7].reshape(*shape, 4)
    values["valid"] = poses[..., 7].reshape(shape) == 1
    return values


def _head_values(schema: StreamSchema, batch: PageBatch, seq: Times, t_ns: Times) -> Values:
    return _pose_values(schema, batch.rows[:, 1:])


def _hands_values(schema: StreamSchema, batch: PageBatch, seq: Times, t_ns: Times) -> Values:
    return _pose_values(schema, batch.rows[:, 1:].reshape(len(batch.rows), -1, 8))


def _pointer_values(schema: StreamSchema, batch: PageBatch, seq: Times, t_ns: Times) -> Values:
    values = _pose_values(schema, batch.rows[:, 2:])
    values["hand"] = batch.rows[:, 1]
    return values


def _response_values(schema: StreamSchema, batch: PageBatch, seq: Times, t_ns: Times) -> Values:
    values = empty_values(schema, len(seq))
    values["control"], values["value_01"] = batch.rows[:, 1], batch.rows[:, 2]
    return values


def _frame_values(schema: StreamSchema, batch: PageBatch, seq: Times, t_ns: Times) -> Values:
    values = empty_values(schema, len(seq))
    xr_ms, predicted_ms, own_ms, skipped, drawn = batch.rows[:, 1:].T
    values["frame"] = values["pose_seq"] = seq
    values["predicted_display_ns"] = NO_DEVICE_TIME  # the browser's XR clock is no other's
    was_submitted = np.isfinite(own_ms) & (drawn == 1)
    own_ns = np.rint(np.nan_to_num(own_ms) * NS_PER_MS).astype(np.int64)
    values["t_submitted_ns"] = np.where(was_submitted, t_ns + own_ns, -1)
    values["skipped"], values["own_ms"], values["drawn"] = skipped, own_ms, drawn == 1
    values["render_gpu_ms"] = np.nan
    for name, since_ms in (("xr_ns", xr_ms), ("predicted_xr_ns", predicted_ms)):
        at_ms = np.nan_to_num((batch.xr0_ms + since_ms) * NS_PER_MS)
        at_ns = np.rint(at_ms).astype(np.int64)
        values[name] = np.where(np.isnan(since_ms), NO_DEVICE_TIME, at_ns)
    return values


VALUES: Final[Mapping[str, Callable[[StreamSchema, PageBatch, Times, Times], Values]]] = {
    "head": _head_values,
    "frame_timing": _frame_values,
    "pointer": _pointer_values,
    "responses": _response_values,
    "hands": _hands_values,
}

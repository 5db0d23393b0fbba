"""Turn gaze samples in the head frame into targets in the scene shown."""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from operator import sub
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.devices.contracts import GAZE, ClockPair
from visavis.lab.clock import NS_PER_S
from visavis.lab.clock_fit import latest_quick, offset_ns
from visavis.lab.compiled import compiled
from visavis.lab.schema import SampleBatch
from visavis.protocol.plan.steps import GazeView
from visavis.protocol.session.head_history import HeadHistory, HeadPoses, head_at
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.stimuli.scene import Scene
from visavis.stimuli.visibility import HIT_LOST, HIT_NOTHING, SceneGeometry, observe_rays

DELAYS_NS = 4 * NS_PER_S
"""How far back samples are searched for the least delay."""
RECENT_EXCHANGES = 24
"""Number of time exchanges from which the tracker's clock is dated: some seconds."""

_GAZE_BYTES = GAZE.dtype.itemsize
_GAZE_FIELDS: Mapping[str, Any] = GAZE.dtype.fields or {}
_DIRECTION_AT, _ORIGIN_AT, _VALID_AT = (
    _GAZE_FIELDS[name][1] for name in ("direction_head", "origin_m", "valid")
)


class _Samples(NamedTuple):
    """What the tracker delivered: n rows of `GAZE.dtype` as bytes, their numbers and stamps.

    A structured array's fields are strided or contiguous depending on n, and each kind would be
    compiled separately.
    """

    rows: npt.NDArray[np.uint8]
    seq: npt.NDArray[np.int64]
    t_device_ns: npt.NDArray[np.int64]


class _Gaze(NamedTuple):
    """What is evaluated of n samples, for the session to read."""

    t_ns: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    rays: npt.NDArray[np.float64]
    """(2, n, 3) direction and origin in world."""
    per_head: npt.NDArray[np.float64]
    """(3, n, agents) angle to each head, its radius and its pad limit, in degrees."""
    hit: npt.NDArray[np.int16]


class _Columns(NamedTuple):
    """The columns of the stream of targets, by their names there."""

    gaze_seq: npt.NDArray[np.int64]
    frame_index: npt.NDArray[np.int32]
    t_sample_ns: npt.NDArray[np.int64]
    valid: npt.NDArray[np.bool_]
    direction_world: npt.NDArray[np.float32]
    origin_world_m: npt.NDArray[np.float32]
    angle_deg: npt.NDArray[np.float32]
    radius_deg: npt.NDArray[np.float32]
    pad_limit_deg: npt.NDArray[np.float32]
    hit: npt.NDArray[np.int16]
    head_beyond_ms: npt.NDArray[np.float32]

    @classmethod
    def of(cls, columns: Mapping[str, npt.NDArray[Any]]) -> "_Columns":
        """Return them from all columns of a buffer.

        One made to be compared with an older recording lacks the last.
        """
        values = dict(columns)
        values.setdefault("head_beyond_ms", np.empty(columns["hit"].shape, np.float32))
        return cls(*(values[name] for name in cls._fields))


@compiled
def _gaze_in_world(
    direction_head: npt.NDArray[np.float32],
    origin_head_m: npt.NDArray[np.float32],
    t_ns: npt.NDArray[np.int64],
    poses: HeadPoses,
    frames: npt.NDArray[np.int64],
    rays: npt.NDArray[np.float64],
    beyond_ms: npt.NDArray[np.float32],
) -> None:
    direction, origin = rays[0], rays[1]
    place, turn = np.empty(3), np.empty(4)
    k_frame = 0
    for i in range(t_ns.shape[0]):
        while i >= frames[k_frame, 0]:
            k_frame += 1
        extent = (
            frames[k_frame, 2],
            frames[k_frame, 3],
            frames[k_frame, 4],
            frames[k_frame, 5],
        )
        beyond_ms[i] = head_at(poses, extent, t_ns[i], place, turn)
        w, x, y, z = turn
        for vector in range(2):
            if vector == 0:
                vx = float(direction_head[i, 0])
                vy = float(direction_head[i, 1])
                vz = float(direction_head[i, 2])
            else:
                vx = float(origin_head_m[i, 0])
                vy = float(origin_head_m[i, 1])
                vz = float(origin_head_m[i, 2])
            # Rotation by a unit quaternion (w, u): v + 2 w (u × v) + 2 u × (u × v).
            tx = 2 * (y * vz - z * vy)
            ty = 2 * (z * vx - x * vz)
            tz = 2 * (x * vy - y * vx)
            rx = vx + w * tx + y * tz - z * ty
            ry = vy + w * ty + z * tx - x * tz
            rz = vz + w * tz + x * ty - y * tx
            if vector == 0:
                size = np.sqrt(rx * rx + ry * ry + rz * rz)
                if size > 0:
                    rx, ry, rz = rx / size, ry / size, rz / size
                direction[i, 0], direction[i, 1], direction[i, 2] = rx, ry, rz
            else:
                origin[i, 0] = rx + place[0]
                origin[i, 1] = ry + place[1]
                origin[i, 2] = rz + place[2]


@compiled
def _evaluate(
    samples: _Samples,
    offset_ns: int,
    frames: npt.NDArray[np.int64],
    poses: HeadPoses,
    heads: npt.NDArray[np.float64],
    capsules: npt.NDArray[np.float64],
    is_lit: bool,
    gaze: _Gaze,
    columns: _Columns,
    row: int,
) -> int:
    """Evaluate n samples into `gaze` and record them in the columns from `row` on; return how many
    are valid.

    Each row of `frames` is a frame that brought samples: how many there are up
    to its end, its index, and the `extent` of the head's history in it.
    One call for all of it, because a frame brings one or two samples.
    """
    t_ns, valid, rays, per_head, hit = gaze.t_ns, gaze.valid, gaze.rays, gaze.per_head, gaze.hit
    rows = samples.rows
    n = samples.seq.shape[0]
    m = heads.shape[1]
    valid_count = 0
    direction_head = np.empty((n, 3), np.float32)
    origin_head_m = np.empty((n, 3), np.float32)
    numbers = np.empty(6, np.float32)
    raw = numbers.view(np.uint8)
    for i in range(n):
        t_ns[i] = samples.t_device_ns[i] + offset_ns
        # Three float32 each of direction and origin, copied byte by byte out of the row.
        for k in range(12):
            raw[k] = rows[i * _GAZE_BYTES + _DIRECTION_AT + k]
            raw[12 + k] = rows[i * _GAZE_BYTES + _ORIGIN_AT + k]
        for k in range(3):
            direction_head[i, k] = numbers[k]
            origin_head_m[i, k] = numbers[3 + k]
        valid[i] = rows[i * _GAZE_BYTES + _VALID_AT] != 0
        valid_count += valid[i]
    beyond_ms = np.empty(n, np.float32)
    _gaze_in_world(direction_head, origin_head_m, t_ns, poses, frames, rays, beyond_ms)
    direction, origin = rays[0], rays[1]
    observe_rays(origin, direction, valid, heads, capsules, is_lit, per_head, hit)
    # The dark scene of calibrations and breaks has no agents, so gaze meets nobody in it.
    angle_deg, radius_deg = columns.angle_deg, columns.radius_deg
    pad_limit_deg = columns.pad_limit_deg
    width = angle_deg.shape[1]
    has_agents = m == width or 0 < m < width  # one film may show fewer than another
    k_frame = 0
    for i in range(n):
        while i >= frames[k_frame, 0]:
            k_frame += 1
        j = row + i
        columns.gaze_seq[j] = samples.seq[i]
        columns.frame_index[j] = frames[k_frame, 1]
        columns.t_sample_ns[j] = t_ns[i]
        columns.valid[j] = valid[i]
        columns.head_beyond_ms[j] = beyond_ms[i]
        for k in range(3):
            columns.direction_world[j, k] = direction[i, k]
            columns.origin_world_m[j, k] = origin[i, k]
        if has_agents:
            for k in range(m):
                angle_deg[j, k] = per_head[0, i, k]
                radius_deg[j, k] = per_head[1, i, k]
                pad_limit_deg[j, k] = per_head[2, i, k]
            for k in range(m, width):
                angle_deg[j, k] = np.nan
                radius_deg[j, k] = np.nan
                pad_limit_deg[j, k] = np.nan
            columns.hit[j] = hit[i]
        else:
            angle_deg[j] = np.nan
            radius_deg[j] = np.nan
            pad_limit_deg[j] = np.nan
            columns.hit[j] = HIT_NOTHING if valid[i] else HIT_LOST
    return valid_count


class LateGaze:
    """The gaze of one frame, evaluated together with that of other frames when first read.

    Has the attributes of a `GazeView` and stands for one in a `FrameView`. `frame` is the frame's
    index and the `HeadHistory.extent` in it, `frame_ns` its session time.
    """

    __slots__ = ("_catch_up", "_samples", "frame", "frame_ns")

    def __init__(
        self, frame: tuple[int, int, int, int, int], frame_ns: int, catch_up: Callable[[], None]
    ) -> None:
        self.frame = frame
        self.frame_ns = frame_ns
        self._catch_up = catch_up
        self._samples: tuple[GazeView, int, int] | None = None

    def set_samples(self, gaze: GazeView, first: int, end: int) -> None:
        """Take the samples `first` to `end` of what was evaluated together."""
        self._samples = gaze, first, end

    @property
    def sample_count(self) -> int:
        """How many samples the frame brought."""
        if self._samples is None:
            self._catch_up()
        return 0 if self._samples is None else self._samples[2] - self._samples[1]

    def __getattr__(self, name: str) -> Any:
        if self._samples is None:
            self._catch_up()
        if self._samples is None or name not in GazeView._fields:
            raise AttributeError(f"gaze has no {name!r}")
        gaze, first, end = self._samples
        values = getattr(gaze, name)
        return values if gaze.t_ns.shape[0] == end - first else values[first:end]


class GazeObserver:
    """Collect gaze batches from the eye tracker and evaluate them once per frame, or later.

    `clock_offset_ns` is host minus device time; it is constant within a trial, so differences
    between sample times are the device's own. Until it is set, the offset of the first batch is
    used, None before that. The tracker's own delay (`delay_ns`) is subtracted, so that a sample's
    time, and the head pose used for it, are those of the eye.
    """

    def __init__(self, targets: RowBuffer, *, delay_ns: int = 0) -> None:
        self.clock_offset_ns: int | None = None
        self._delay_ns = delay_ns
        self._targets = targets
        self._source = targets.columns
        self._columns = _Columns.of(targets.columns)
        self._spare: _Columns | None = None
        self._inbox: deque[SampleBatch] = deque()
        self._arrivals_and_delays_ns: deque[tuple[int, int]] = deque()
        self.heads = HeadHistory()
        """Where the head was, and is foreseen to be; gaze is turned by it."""
        self._waiting: list[LateGaze] = []
        self._scene: Scene | None = None
        self._geometry: SceneGeometry | None = None
        self._empty = _no_gaze(0)
        self.received_count = 0
        self.valid_count = 0

    def take(self, batch: SampleBatch) -> None:
        """Accept a batch of the gaze stream; may be called from the device's thread."""
        self._inbox.append(batch)
        arrivals_ns = batch.t_host_ns.tolist()
        delays_ns = list(map(sub, arrivals_ns, batch.t_device_ns.tolist()))
        recent = self._arrivals_and_delays_ns
        recent.extend(zip(arrivals_ns, delays_ns, strict=True))
        while recent[0][0] < arrivals_ns[-1] - DELAYS_NS:
            recent.popleft()
        if self.clock_offset_ns is None:
            self.clock_offset_ns = min(delays_ns)

    def align(self, exchanges: Sequence[ClockPair]) -> None:
        """Date coming samples by the present estimate of the tracker's clock offset."""
        recent = exchanges[-RECENT_EXCHANGES:]
        if recent:
            self.clock_offset_ns = offset_ns(latest_quick(recent))
        elif (least_ns := self.least_delay_ns) is not None:
            self.clock_offset_ns = least_ns

    @property
    def least_delay_ns(self) -> int | None:
        """Least difference of arrival and device time lately; None before the first sample.

        For a tracker that cannot report its time, this is its clock's offset plus the least delay.
        """
        recent = tuple(self._arrivals_and_delays_ns)
        return min((delay_ns for _, delay_ns in recent), default=None)

    def times_ns(self, batch: SampleBatch) -> npt.NDArray[np.int64]:
        """Return the session times (n,) at which the eyes of a batch's samples were seen."""
        times: npt.NDArray[np.int64] = (
            batch.t_device_ns + (self.clock_offset_ns or 0) - self._delay_ns
        )
        return times

    def show(self, scene: Scene) -> None:
        """State the scene on display, in which coming samples are evaluated."""
        if scene is not self._scene:
            self._scene = scene
            self._empty = _no_gaze(len(scene.agents))
            self._geometry = SceneGeometry.from_scene(scene)

    def observe(self, frame_index: int, t_frame_ns: int) -> GazeView:
        """Evaluate everything that arrived, record it, and return it."""
        batch = self._gather() if self._inbox else None
        if batch is None or self._geometry is None:
            return self._empty
        n = batch.seq.shape[0]
        frames = np.array([(n, frame_index, *self.heads.extent)], np.int64)
        gaze = self._recorded(batch, self._geometry, frames)
        self._targets.commit(n, t_frame_ns)
        return gaze

    def wait(self, frame_index: int, t_frame_ns: int, catch_up: Callable[[], None]) -> LateGaze:
        """Defer what this frame brings; `catch_up` is called when it is first read.

        `MAX_WAITING` frames may wait, in one scene and with one clock offset.
        """
        return self.wait_with(frame_index, self.heads.extent, t_frame_ns, catch_up)

    def wait_with(
        self,
        frame_index: int,
        extent: tuple[int, int, int, int],
        t_frame_ns: int,
        catch_up: Callable[[], None],
    ) -> LateGaze:
        """Do what `wait` does for a frame in which the head's history had this extent."""
        gaze = LateGaze((frame_index, *extent), t_frame_ns, catch_up)
        self._waiting.append(gaze)
        return gaze

    def observe_waiting(self) -> Sequence[int]:
        """Evaluate deferred samples as each waiting frame would have; return counts per frame."""
        waiting, self._waiting = self._waiting, []
        batch = self._gather(waiting[-1].frame_ns) if self._inbox and waiting else None
        if batch is None or self._geometry is None:
            for one in waiting:
                one.set_samples(self._empty, 0, 0)
            return [0] * len(waiting)
        if len(waiting) == 1:
            one, n = waiting[0], batch.seq.shape[0]
            frames = np.array([(n, *one.frame)], np.int64)
            one.set_samples(self._recorded(batch, self._geometry, frames), 0, n)
            self._targets.commit(n, one.frame_ns)
            return [n]
        # Messages arrive in order, and a frame takes those that have arrived by its time.
        there_ns = np.maximum.accumulate(batch.t_host_ns)
        frames_ns = [one.frame_ns for one in waiting]
        ends = np.searchsorted(there_ns, frames_ns, side="right")
        frames = np.empty((len(waiting), 6), np.int64)
        frames[:, 0], frames[:, 1:] = ends, [one.frame for one in waiting]
        gaze = self._recorded(batch, self._geometry, frames)
        counts = ends.copy()
        counts[1:] -= ends[:-1]
        self._targets.commit_stamped(np.repeat(frames_ns, counts))
        first = 0
        for one, end in zip(waiting, ends.tolist(), strict=True):
            one.set_samples(gaze, first, end)
            first = end
        sample_counts: list[int] = counts.tolist()
        return sample_counts

    def ahead(
        self,
        batch: SampleBatch,
        frames_ns: Sequence[int],
        foreseen_ns: Sequence[int],
        poses: npt.NDArray[np.float32],
    ) -> tuple[GazeView, npt.NDArray[np.intp]] | None:
        """Return what coming frames will make of samples, and in which frame each arrives.

        `frames_ns`, `foreseen_ns` and `poses` are those of `FramesAhead`. None where this is not
        known; nothing is recorded.
        """
        n = batch.seq.shape[0]
        if self._geometry is None or self.clock_offset_ns is None or self._waiting or self._inbox:
            return None
        if self._spare is None:
            self._spare = _Columns.of(self._targets.spare_columns())
        if n > self._spare.hit.shape[0]:
            return None
        heads = self.heads.copy()
        extents = heads.add_together(frames_ns, foreseen_ns, poses)
        there_ns = np.maximum.accumulate(batch.t_host_ns)
        frame_of = np.searchsorted(np.array(frames_ns), there_ns, side="left")
        frames = np.empty((len(frames_ns), 6), np.int64)
        frames[:, 0] = np.searchsorted(there_ns, np.array(frames_ns), side="right")
        frames[:, 1], frames[:, 2:] = -1, extents
        if not n or frames[-1, 0] < n:
            return (self._empty, frame_of) if not n else None
        gaze, _ = self._evaluated(batch, self._geometry, frames, heads, self._spare, 0)
        return gaze, frame_of

    def _recorded(
        self, batch: SampleBatch, geometry: SceneGeometry, frames: npt.NDArray[np.int64]
    ) -> GazeView:
        """Evaluate samples and write their rows; the caller counts them."""
        n = batch.seq.shape[0]
        targets = self._targets
        at = targets.room(n)
        if targets.columns is not self._source:
            self._source = targets.columns
            self._columns = _Columns.of(targets.columns)
        gaze, valid_count = self._evaluated(batch, geometry, frames, self.heads, self._columns, at)
        self.received_count += n
        self.valid_count += valid_count
        return gaze

    def _evaluated(
        self,
        batch: SampleBatch,
        geometry: SceneGeometry,
        frames: npt.NDArray[np.int64],
        heads: HeadHistory,
        columns: _Columns,
        at: int,
    ) -> tuple[GazeView, int]:
        """Return the gaze of samples and how many are valid; write columns from row `at` on."""
        n = batch.seq.shape[0]
        assert self.clock_offset_ns is not None  # noqa: S101 - the callers looked
        gaze = _Gaze(
            np.empty(n, np.int64),
            np.empty(n, np.bool_),
            np.empty((2, n, 3)),
            np.empty((3, n, geometry.heads.shape[0])),
            np.empty(n, np.int16),
        )
        heads_m = geometry.heads_at(batch.t_device_ns + (self.clock_offset_ns - self._delay_ns))
        valid_count = _evaluate(
            _Samples(np.frombuffer(batch.values.tobytes(), np.uint8), batch.seq, batch.t_device_ns),
            self.clock_offset_ns - self._delay_ns,
            frames,
            heads.poses,
            heads_m,
            geometry.capsules,
            geometry.is_lit,
            gaze,
            columns,
            at,
        )
        rays, per_head = gaze.rays, gaze.per_head
        if geometry.room is not None:
            geometry.hide(rays[1], rays[0], heads_m, per_head, gaze.hit)
            columns.hit[at : at + n] = gaze.hit
            columns.pad_limit_deg[at : at + n] = per_head[2]
        view = GazeView(
            gaze.t_ns, gaze.valid, rays[0], rays[1], per_head[0], per_head[1], per_head[2], gaze.hit
        )
        return view, valid_count

    def drain(self) -> list[SampleBatch]:
        """Return what arrived without evaluating it."""
        batches = []
        while self._inbox:
            batches.append(self._inbox.popleft())
        return batches

    def _gather(self, until_ns: int | None = None) -> SampleBatch | None:
        """Return what has arrived as one batch; the next frame takes what came after a time, to
        which a question to the tracker may have moved a virtual clock meanwhile.
        """
        batch = _one_batch_of(self.drain())
        if batch is None or until_ns is None or batch.t_host_ns[-1] <= until_ns:
            return batch
        n = int(np.searchsorted(np.maximum.accumulate(batch.t_host_ns), until_ns, side="right"))
        self._inbox.append(batch.part(n, len(batch)))
        return batch.part(0, n) if n else None


def _one_batch_of(batches: Sequence[SampleBatch]) -> SampleBatch | None:
    """Return batches of gaze as one; None of none."""
    if len(batches) < 2:
        return batches[0] if batches else None
    return SampleBatch(
        batches[0].schema,
        np.concatenate([b.seq for b in batches]),
        np.concatenate([b.t_device_ns for b in batches]),
        np.concatenate([b.t_host_ns for b in batches]),
        # joining structured arrays goes field by field and takes ten times as long
        np.frombuffer(b"".join([b.values.tobytes() for b in batches]), GAZE.dtype),
    )


def _no_gaze(agent_count: int) -> GazeView:
    empty = np.empty((0, agent_count))
    return GazeView(
        np.empty(0, dtype=np.int64),
        np.empty(0, dtype=np.bool_),
        np.empty((0, 3)),
        np.empty((0, 3)),
        empty,
        empty,
        empty,
        np.empty(0, dtype=np.int16),
    )

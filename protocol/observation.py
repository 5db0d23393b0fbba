"""Turn gaze samples in the head frame into what they meant in the scene shown."""

from collections import deque

import numpy as np
import numpy.typing as npt

from lab.compiled import compiled
from lab.geometry import Pose
from lab.schema import SampleBatch
from protocol.row_buffer import RowBuffer
from protocol.steps import GazeView
from stimuli.scene import Scene
from stimuli.visibility import SceneGeometry

POSES_KEPT = 32
"""Head poses remembered for looking up the pose at a sample's time: 0.3 s at 90 Hz."""


@compiled
def _gaze_in_world(
    direction_head: npt.NDArray[np.float32],
    origin_head_m: npt.NDArray[np.float32],
    t_ns: npt.NDArray[np.int64],
    pose_t_ns: npt.NDArray[np.int64],
    pose_p: npt.NDArray[np.float64],
    pose_q: npt.NDArray[np.float64],
    newest: int,
    count: int,
    direction: npt.NDArray[np.float64],
    origin: npt.NDArray[np.float64],
) -> None:
    kept = pose_t_ns.shape[0]
    for i in range(t_ns.shape[0]):
        b = newest
        steps = 1
        while steps < count and pose_t_ns[(b - 1 + kept) % kept] > t_ns[i]:
            b = (b - 1 + kept) % kept
            steps += 1
        a = (b - 1 + kept) % kept if steps < count else b
        f = 0.0
        span = pose_t_ns[b] - pose_t_ns[a]
        if span > 0:
            f = min(max((t_ns[i] - pose_t_ns[a]) / span, 0.0), 1.0)
        dot = 0.0
        for k in range(4):
            dot += pose_q[a, k] * pose_q[b, k]
        sign = 1.0 if dot >= 0 else -1.0
        w = (1 - f) * pose_q[a, 0] + f * sign * pose_q[b, 0]
        x = (1 - f) * pose_q[a, 1] + f * sign * pose_q[b, 1]
        y = (1 - f) * pose_q[a, 2] + f * sign * pose_q[b, 2]
        z = (1 - f) * pose_q[a, 3] + f * sign * pose_q[b, 3]
        length = np.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / length, x / length, y / length, z / length
        for turn in range(2):
            if turn == 0:
                vx = float(direction_head[i, 0])
                vy = float(direction_head[i, 1])
                vz = float(direction_head[i, 2])
            else:
                vx = float(origin_head_m[i, 0])
                vy = float(origin_head_m[i, 1])
                vz = float(origin_head_m[i, 2])
            tx = 2 * (y * vz - z * vy)
            ty = 2 * (z * vx - x * vz)
            tz = 2 * (x * vy - y * vx)
            rx = vx + w * tx + y * tz - z * ty
            ry = vy + w * ty + z * tx - x * tz
            rz = vz + w * tz + x * ty - y * tx
            if turn == 0:
                size = np.sqrt(rx * rx + ry * ry + rz * rz)
                if size > 0:
                    rx, ry, rz = rx / size, ry / size, rz / size
                direction[i, 0], direction[i, 1], direction[i, 2] = rx, ry, rz
            else:
                origin[i, 0] = rx + (1 - f) * pose_p[a, 0] + f * pose_p[b, 0]
                origin[i, 1] = ry + (1 - f) * pose_p[a, 1] + f * pose_p[b, 1]
                origin[i, 2] = rz + (1 - f) * pose_p[a, 2] + f * pose_p[b, 2]


class GazeObserver:
    """Collect gaze batches from the eye tracker and evaluate them once per frame.

    `clock_offset_ns` is host minus device time; it is constant within a trial, so differences
    between sample times are the device's own.
    """

    def __init__(self, targets: RowBuffer) -> None:
        self.clock_offset_ns = 0
        self._targets = targets
        self._inbox: deque[SampleBatch] = deque()
        self._pose_t_ns = np.zeros(POSES_KEPT, dtype=np.int64)
        self._pose_p = np.zeros((POSES_KEPT, 3))
        self._pose_q = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (POSES_KEPT, 1))
        self._newest = -1
        self._poses = 0
        self._scene: Scene | None = None
        self._geometry: SceneGeometry | None = None
        self.received = 0
        self.valid = 0

    def take(self, batch: SampleBatch) -> None:
        """Accept a batch of the gaze stream; may be called from the device's thread."""
        self._inbox.append(batch)

    def add_pose(self, t_ns: int, pose: Pose) -> None:
        """Remember where the head was."""
        self._newest = (self._newest + 1) % POSES_KEPT
        self._pose_t_ns[self._newest] = t_ns
        self._pose_p[self._newest] = pose.position_m
        self._pose_q[self._newest] = pose.orientation_wxyz
        self._poses = min(self._poses + 1, POSES_KEPT)

    def show(self, scene: Scene) -> None:
        """State the scene on display, in which coming samples are evaluated."""
        if scene is not self._scene:
            self._scene = scene
            self._geometry = SceneGeometry.from_scene(scene)

    def observe(self, frame_index: int, t_frame_ns: int) -> GazeView:
        """Evaluate everything that arrived, record it, and return it."""
        batch = self._gather()
        if batch is None or self._geometry is None:
            return self._nothing()
        values = batch.values
        n = len(batch)
        t_ns = batch.t_device_ns + self.clock_offset_ns
        direction = np.empty((n, 3))
        origin = np.empty((n, 3))
        _gaze_in_world(
            np.ascontiguousarray(values["direction_head"]),
            np.ascontiguousarray(values["origin_m"]),
            t_ns,
            self._pose_t_ns,
            self._pose_p,
            self._pose_q,
            self._newest,
            self._poses,
            direction,
            origin,
        )
        valid = np.ascontiguousarray(values["valid"])
        angle, radius, pad, hit = self._geometry.observe(origin, direction, valid)
        view = GazeView(t_ns, valid, direction, origin, angle, radius, pad, hit)
        self.received += n
        self.valid += int(valid.sum())
        self._record(batch, frame_index, t_frame_ns, view)
        return view

    def drain(self) -> list[SampleBatch]:
        """Return what arrived without evaluating it."""
        batches = []
        while self._inbox:
            batches.append(self._inbox.popleft())
        return batches

    def _gather(self) -> SampleBatch | None:
        batches = self.drain()
        if not batches:
            return None
        if len(batches) == 1:
            return batches[0]
        return SampleBatch(
            batches[0].schema,
            np.concatenate([b.seq for b in batches]),
            np.concatenate([b.t_device_ns for b in batches]),
            np.concatenate([b.t_host_ns for b in batches]),
            np.concatenate([b.values for b in batches]),
        )

    def _nothing(self) -> GazeView:
        m = len(self._scene.agents) if self._scene is not None else 0
        empty = np.empty((0, m))
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

    def _record(self, batch: SampleBatch, frame: int, t_frame_ns: int, view: GazeView) -> None:
        rows = self._targets
        n = len(batch)
        i = rows.room(n)
        j = i + n
        columns = rows.columns
        columns["gaze_seq"][i:j] = batch.seq
        columns["frame_index"][i:j] = frame
        columns["t_sample_ns"][i:j] = view.t_ns
        columns["valid"][i:j] = view.valid
        columns["direction_world"][i:j] = view.direction_world
        columns["origin_world_m"][i:j] = view.origin_world_m
        m = view.angle_deg.shape[1]
        if m == columns["angle_deg"].shape[1]:
            columns["angle_deg"][i:j] = view.angle_deg
            columns["radius_deg"][i:j] = view.radius_deg
            columns["pad_limit_deg"][i:j] = view.pad_limit_deg
            columns["hit"][i:j] = view.hit
        else:
            columns["angle_deg"][i:j] = np.nan
            columns["radius_deg"][i:j] = np.nan
            columns["pad_limit_deg"][i:j] = np.nan
            columns["hit"][i:j] = np.where(view.valid, -1, -2)
        rows.commit(n, t_frame_ns)

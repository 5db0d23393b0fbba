"""The scene shown in one frame as recorded, for drawing it again."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import pandas as pd

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.protocol.plan.session_plan import Trial
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import Recording
from visavis.stimuli.moving_heads import HEADS_MOVE
from visavis.stimuli.scene import Agent, Scene, SceneFrame

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class _Entries:
    """Events of one name as arrays: of the n earliest, `last_row[n - 1]` was written last."""

    t_ns: npt.NDArray[np.int64]
    payloads: list[dict[str, Any]]
    sorted_ns: npt.NDArray[np.int64]
    last_row: npt.NDArray[np.int64]

    @classmethod
    def of(cls, events: pd.DataFrame) -> "_Entries":
        t_ns = events["t_ns"].to_numpy(np.int64)
        order = np.argsort(t_ns, kind="stable")
        last_row = np.maximum.accumulate(order)
        return cls(t_ns, list(events["payload"]), t_ns[order], last_row)


@dataclass(frozen=True, eq=False)
class Frames:
    """Which row holds which frame: `highest` up to each row, and rows by frame, `order`."""

    numbers: npt.NDArray[np.int64]
    highest: npt.NDArray[np.int64]
    order: npt.NDArray[np.int64]

    @classmethod
    def of(cls, frames: dict[str, Any]) -> "Frames":
        """Take the columns of the stream `frames`."""
        numbers = frames["frame_index"].astype(np.int64)
        order = np.argsort(numbers, kind="stable")
        return cls(numbers, np.maximum.accumulate(numbers), order)

    def rows(self, frame: int) -> tuple[int | None, int | None]:
        """Return the first row of a frame and the first of a later one, None without."""
        n = len(self.numbers)
        at = int(np.searchsorted(self.numbers, frame, sorter=self.order))
        later = int(np.searchsorted(self.highest, frame, side="right"))
        is_here = at < n and self.numbers[self.order[at]] == frame
        return int(self.order[at]) if is_here else None, later if later < n else None


def _once(recording: Recording, key: Hashable, make: Callable[[], T]) -> T:
    """Return what `make` returns, made once where the recording is kept."""
    if isinstance(recording, CachedRecording):
        return recording.once(key, make)
    return make()


@dataclass(frozen=True, eq=False)
class RecordedScene:
    """The scene of a frame as recorded.

    `description` is the event "scene" of the static scene, logged at `since_ns`; `t_ns` the
    frame's time, `t_scene_ns` the moment drawn, `head_m` (3,) where it was drawn from. Gaze and
    openness are those of the scene's agents.
    """

    recording: Recording
    part: int
    t_ns: int
    t_scene_ns: int
    head_m: Vector
    since_ns: int
    description: dict[str, Any]
    gaze_direction: Vector
    eye_openness_01: Vector
    gaze_distance_m: Vector | None = None

    @property
    def scene(self) -> Scene:
        """The static scene, without what a study adds to it."""
        mark = self.description.get("mark_m")
        return Scene(
            str(self.description["scene_name"]),
            tuple(_agent(raw) for raw in self.description["agents"]),
            brightness_01=float(self.description["brightness_01"]),
            mark_m=None if mark is None else np.array(mark),
        )

    @property
    def view(self) -> SceneFrame:
        """The frame of a study whose scenes contain agents only."""
        return SceneFrame(
            self.scene,
            self.t_scene_ns,
            self.gaze_direction,
            self.eye_openness_01,
            gaze_distance_m=self.gaze_distance_m,
        )

    @property
    def heads_move(self) -> bool:
        """Whether gaze was measured on heads where they were at the time of each sample."""
        return bool(self.description.get(HEADS_MOVE, False))

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what `make` returns, made once where the recording is kept; for costly things that
        many frames share.
        """
        return _once(self.recording, (self.part, key), make)

    def latest(self, event: str) -> tuple[int, dict[str, Any]] | None:
        """Return time and payload of the last event of a name up to this frame, None before."""
        entries = self.once(
            ("latest", event), lambda: _Entries.of(_events(self.recording, event, self.part))
        )
        count = int(np.searchsorted(entries.sorted_ns, self.t_ns, side="right"))
        if count == 0:
            return None
        row = int(entries.last_row[count - 1])
        return int(entries.t_ns[row]), dict(entries.payloads[row])

    def with_onset(self, event: str) -> dict[str, Any] | None:
        """Return the payload of the event of a name that says of itself that it began with the
        scene; None without one. It is written a frame later, when the scene is lit.
        """
        payloads = _events(self.recording, event, self.part)["payload"]
        mine = (p for p in payloads if p.get("start_ns") == self.since_ns)
        return next((dict(payload) for payload in mine), None)

    def since(self, event: str) -> list[dict[str, Any]]:
        """Return the payloads of a name's events from the scene's beginning up to this frame."""
        events = _events(self.recording, event, self.part)
        here = (events["t_ns"] >= self.since_ns) & (events["t_ns"] <= self.t_ns)
        return [dict(payload) for payload in events[here]["payload"]]

    def trial(self) -> Trial:
        """Return the planned trial that had begun last when this frame was shown.

        Raises:
            DataError: no trial had begun, or the plan does not have it.
        """
        start = self.latest("trial_start")
        if start is None:
            raise DataError(f"{self.recording.path}: no trial had begun at {self.t_ns} ns")
        for block in self.recording.manifest.plan["blocks"]:
            for trial_fields in block["trials"]:
                if trial_fields["trial_id"] == start[1]["trial_id"]:
                    return Trial(**trial_fields)
        raise DataError(
            f"{self.recording.path}: trial {start[1]['trial_id']} is not in the session's plan"
        )


def recorded_scene(
    recording: Recording, part: int, frame: int, t_scene_ns: int, head_m: Vector
) -> RecordedScene:
    """Return the scene that was shown when a frame was drawn.

    Raises:
        DataError: the recording does not have the frame, or not its scene.
    """
    frames = of_part(recording, "frames", part)
    states = of_part(recording, "scene_states", part)
    here, later = _once(recording, (part, "frames"), lambda: Frames.of(frames)).rows(frame)
    if here is None:
        raise DataError(f"{recording.path}: part {part} has no frame {frame}")
    # What is drawn in a frame is on display by the next: its row says which state that was.
    k = len(states["scene"]) - 1 if later is None else int(frames["scene_row"][later])
    scenes = _events(recording, "scene", part)
    numbers = [payload["scene"] for payload in scenes["payload"]]
    if not 0 <= k < len(states["scene"]) or int(states["scene"][k]) not in numbers:
        raise DataError(f"{recording.path}: the scene of frame {frame} was not recorded")
    row = scenes.iloc[numbers.index(int(states["scene"][k]))]
    n = len(row["payload"]["agents"])
    return RecordedScene(
        recording,
        part,
        int(frames["t_host_ns"][here]),
        t_scene_ns,
        head_m,
        int(row["t_ns"]),
        dict(row["payload"]),
        states["gaze_direction"][k][:n].astype(np.float64),
        states["eye_openness_01"][k][:n].astype(np.float64),
        # Recordings from before 2027 have no vergence distance.
        states["gaze_distance_m"][k][:n].astype(np.float64)
        if "gaze_distance_m" in states
        else None,
    )


def of_part(recording: Recording, stream: str, part: int) -> dict[str, Any]:
    """Return the columns of a stream as one part of the session recorded them."""
    return recording.stream_arrays(stream, part=part)


def _events(recording: Recording, name: str, part: int) -> pd.DataFrame:
    return recording.events_named(name, part)


def _agent(raw: dict[str, Any]) -> Agent:
    return Agent(
        raw["agent_id"],
        raw["character"],
        raw["place"],
        np.array(raw["head_centre_m"]),
        float(raw["head_radius_m"]),
        np.array(raw["facing"]),
        np.array(raw["eye_centre_m"]),
    )

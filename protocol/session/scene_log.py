"""What participants were shown, as the recording has it: scenes, their states, windows on them."""

from collections.abc import Callable, Sequence
from itertools import accumulate

import numpy as np

from visavis.lab.clock import NS_PER_MS
from visavis.lab.schema import StreamSchema
from visavis.protocol.plan.steps import Pictures
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.protocol.session.streams import GAZE_WINDOWS
from visavis.recording.writer import Recorder
from visavis.stimuli.gaze_window import WindowPlace
from visavis.stimuli.moving_heads import HEADS_MOVE, moving_heads
from visavis.stimuli.own_room import PlacedRoom
from visavis.stimuli.room_areas import ROOM_SHAPE
from visavis.stimuli.room_shape import shape_of
from visavis.stimuli.scene import Scene, SceneFrame


class SceneLog:
    """Record what is new in what is shown, frame by frame or for many frames at once.

    `show` is called with every new scene, before its first state is recorded.
    """

    def __init__(
        self,
        states: StreamSchema,
        recorder: Recorder,
        agent_count: int,
        hold_ns: int,
        show: Callable[[Scene], None],
    ) -> None:
        self._recorder = recorder
        self._agent_count = agent_count
        self._show = show
        self._states = RowBuffer(states, recorder.append, hold_ns=hold_ns)
        self._windows = RowBuffer(GAZE_WINDOWS, recorder.append, hold_ns=hold_ns)
        self._scene_number = 0
        self._rooms: set[str] = set()
        self.view: SceneFrame | None = None
        """What was recorded last."""
        self.window_at: WindowPlace | None = None
        """Where the window was last that follows gaze."""

    @property
    def state(self) -> int:
        """The number of the last state; -1 before the first."""
        return self._states.rows - 1

    def flush(self) -> None:
        """Hand every held row to the recorder."""
        self._states.flush()
        self._windows.flush()

    def add(self, view: SceneFrame, t_ns: int) -> None:
        """Record what is new in a view.

        Raises:
            ValueError: more people are in it than the study's scenes have.
        """
        before = self.view
        if before is None or view.scene is not before.scene:
            self._scene_number += 1
            self._show(view.scene)
            self._recorder.event("scene", t_ns, **self._describe(view.scene))
            self._describe_room(view.scene.room, t_ns)
        elif (
            view.gaze_direction is before.gaze_direction
            and view.eye_openness_01 is before.eye_openness_01
        ):
            self.view = view
            return
        self.view = view
        agent_count = view.gaze_direction.shape[0]
        if agent_count > self._agent_count:
            raise ValueError(
                f"a scene holds {agent_count} agents, and the study's have room for fewer"
            )
        i = self._states.room(1)
        columns = self._states.columns
        columns["scene"][i] = self._scene_number
        for name, values in (
            ("gaze_direction", view.gaze_direction),
            ("eye_openness_01", view.eye_openness_01),
            ("gaze_distance_m", view.gaze_distance_m),
        ):
            row = columns[name][i]
            if values is None or agent_count < self._agent_count:
                row[...] = np.nan
            if values is not None:
                row[:agent_count] = values
        self._states.commit(1, t_ns)

    def add_together(self, t_ns: Sequence[int], pictures: Pictures, n: int) -> list[int]:
        """Record what n frames show after the first; return the number of the last state in
        each.
        """
        first = self.state
        # what is new after the last of the frames is recorded with the next
        new = np.flatnonzero(pictures.is_new[: n - 1])
        count = len(new)
        if count:
            i = self._states.room(count)
            columns, m = self._states.columns, pictures.gaze_direction.shape[1]
            columns["scene"][i : i + count] = self._scene_number
            for name, values in (
                ("gaze_direction", pictures.gaze_direction),
                ("eye_openness_01", pictures.eye_openness_01),
                ("gaze_distance_m", pictures.gaze_distance_m),
            ):
                rows = columns[name][i : i + count]
                if m < self._agent_count:
                    rows[...] = np.nan
                rows[:, :m] = values[new]
            self._states.commit_stamped(np.array(t_ns)[new])
            self.view = pictures.after(int(new[-1]))
        return list(accumulate(pictures.is_new[: n - 1].tolist(), initial=first))

    def add_window(self, place: WindowPlace | None, drawn_ns: int, lit_ns: int) -> None:
        """Record where the window is that follows gaze, and how late it came."""
        self.window_at = place
        if place is None:
            return
        sample_ns = place.t_sample_ns
        delay_ms = np.nan if sample_ns is None else (lit_ns - sample_ns) / NS_PER_MS
        valid = sample_ns is not None
        row = (drawn_ns, sample_ns if valid else -1, valid, place.direction, place.eye_m, delay_ms)
        self._windows.add(row, lit_ns)

    def _describe_room(self, room: PlacedRoom | None, t_ns: int) -> None:
        """Record the meshes of a laboratory's own room before gaze first falls on them."""
        if room is None:
            return
        shape = shape_of(room)
        if shape.sha256 not in self._rooms:
            self._rooms.add(shape.sha256)
            self._recorder.event(ROOM_SHAPE, t_ns, **shape.event)

    def _describe(self, scene: Scene) -> dict[str, object]:
        return {
            "scene": self._scene_number,
            "scene_name": scene.name,
            "brightness_01": scene.brightness_01,
            "mark_m": None if scene.mark_m is None else [float(x) for x in scene.mark_m],
            **({} if moving_heads(scene) is None else {HEADS_MOVE: True}),
            "agents": [
                {
                    "agent_id": a.agent_id,
                    "character": a.character,
                    "place": a.place,
                    "head_centre_m": [float(x) for x in a.head_centre_m],
                    "head_radius_m": a.head_radius_m,
                    "facing": [float(x) for x in a.facing],
                    "eye_centre_m": [float(x) for x in a.eye_centre_m],
                }
                for a in scene.agents
            ],
        }

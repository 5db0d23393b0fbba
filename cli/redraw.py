"""Draw a frame of a recording again, from what the recording alone says."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cli.stages import dresser_of
from lab.clock import SimClock
from lab.errors import DataError, UsageError
from recording.reader import Recording
from stage.drawn_stage import Display, DrawnStage
from stage.frame_truth import read_views
from stage.renderer import Image, Renderer
from stimuli.scene import Agent, Scene, SceneFrame

REBUILT = ("stare",)
"""Studies whose scenes are recorded whole, so that a frame needs nothing but the recording."""


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A drawn frame as recorded: the scene, its row of `drawn` and that of `drawn_views`."""

    view: SceneFrame
    drawn: np.void
    views: np.void


def recorded_frame(recording: Recording, frame: int, *, part: int | None = None) -> RecordedFrame:
    """Return everything a re-draw of a frame needs; `part` of the session is the first by default.

    Raises:
        UsageError: nothing was drawn in this frame, or the study's scenes cannot be rebuilt.
    """
    study = recording.manifest.study
    if study not in REBUILT:
        raise UsageError(
            f"frames of {study!r} cannot be rebuilt from the recording alone; "
            f"known: {', '.join(REBUILT)}"
        )
    if "drawn" not in recording.stream_names:
        raise UsageError(
            f"{recording.path}: nothing was drawn in this session (display.show was none)"
        )
    wanted = recording.manifest.parts[0].number if part is None else part
    drawn = _of_part(recording, "drawn", wanted)
    at = np.flatnonzero(drawn["frame"] == frame)
    if not len(at) or not drawn["drawn"][at[0]]:
        numbers = drawn["frame"][drawn["drawn"]]
        known = f"{numbers[0]} to {numbers[-1]}" if len(numbers) else "none"
        raise UsageError(f"frame {frame} was not drawn in part {wanted}; drawn: {known}")
    row = _row(recording, "drawn", drawn, int(at[0]))
    views = _of_part(recording, "drawn_views", wanted)
    latest = int(np.flatnonzero(views["t_host_ns"] <= drawn["t_host_ns"][at[0]])[-1])
    view = _scene_frame(recording, frame, wanted, int(row["t_scene_ns"]))
    return RecordedFrame(view, row, _row(recording, "drawn_views", views, latest))


def redraw(recording: Recording, frame: int, *, part: int | None = None) -> list[Image]:
    """Draw a recorded frame again; return its images, left first, equal within rounding.

    Raises:
        UsageError: see `recorded_frame`.
        StageError: nothing can draw here, or this version dresses the scene in another way.
    """
    found = recorded_frame(recording, frame, part=part)
    views, size_px, quality = read_views(found.views)
    people = len(found.drawn["level"])
    stage = DrawnStage(
        dresser_of(recording.manifest.study),
        lambda: Renderer(quality=quality),
        Display(lambda: views, lambda: size_px, people),
        SimClock(),
    )
    try:
        return stage.redraw(found.view, found.drawn)
    finally:
        stage.close()


def _of_part(recording: Recording, name: str, part: int) -> dict[str, Any]:
    arrays = recording.stream_arrays(name)
    mine = arrays["recording_part"] == part
    return {column: values[mine] for column, values in arrays.items()}


def _row(recording: Recording, name: str, arrays: dict[str, Any], i: int) -> np.void:
    schema = recording.stream_schema(name)
    if schema is None:
        raise DataError(f"{recording.path}: stream {name} has no schema")
    row = np.zeros(1, schema.dtype)[0]
    for field in schema.fields:
        row[field.name] = arrays[field.name][i]
    return row  # type: ignore[no-any-return]  # an element of a structured array


def _scene_frame(recording: Recording, frame: int, part: int, t_ns: int) -> SceneFrame:
    frames = _of_part(recording, "frames", part)
    states = _of_part(recording, "scene_states", part)
    # What is drawn in a frame is on display by the next: its row says which state that was.
    later = np.flatnonzero(frames["frame_index"] > frame)
    k = int(frames["scene_row"][later[0]]) if len(later) else len(states["scene"]) - 1
    events = recording.events()
    scenes = events[(events["name"] == "scene") & (events["recording_part"] == part)]
    event = next(p for p in scenes["payload"] if p["scene"] == states["scene"][k])
    agents = tuple(_agent(raw) for raw in event["agents"])
    mark = event.get("mark_m")
    scene = Scene(
        str(event["scene_name"]),
        agents,
        brightness_01=float(event["brightness_01"]),
        mark_m=None if mark is None else np.array(mark),
    )
    n = len(agents)
    gaze = states["gaze_direction"][k][:n].astype(np.float64)
    openness = states["eye_openness_01"][k][:n].astype(np.float64)
    return SceneFrame(scene, t_ns, gaze, openness)


def _agent(raw: dict[str, Any]) -> Agent:
    return Agent(
        raw["agent_id"], raw["character"], raw["place"], np.array(raw["head_centre_m"]),
        float(raw["head_radius_m"]), np.array(raw["facing"]), np.array(raw["eye_centre_m"]),
    )  # fmt: skip

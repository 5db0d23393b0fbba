"""Draw a frame of a recording again, from what the recording alone says."""

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lab.clock import SimClock
from lab.errors import DataError, UsageError
from protocol.shown import Shown, of_part, shown_in
from recording.reader import Recording
from stage.drawn_stage import Display, DrawnStage
from stage.frame_truth import read_views
from stage.renderer import Image, Renderer
from stimuli.dressing.picture_of import picture_of
from stimuli.scene import SceneFrame
from visavis.sessions.study_folder import study_of_folder


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A drawn frame as recorded: what it may have shown (the row's checksum tells which), what was
    lit last if its light was still going, its row of `drawn` and that of `drawn_views`.
    """

    views_shown: tuple[SceneFrame, ...]
    views_lit: tuple[SceneFrame, ...]
    drawn: np.void
    views: np.void


def recorded_frame(recording: Recording, frame: int, *, part: int | None = None) -> RecordedFrame:
    """Return everything a re-draw of a frame needs; `part` of the session is the first by default.

    Raises:
        UsageError: nothing was drawn in this frame, or the study's file is gone.
    """
    study, _ = study_of_folder(recording.path.resolve().parent.parent, recording.manifest.study)
    if "drawn" not in recording.stream_names:
        raise UsageError(
            f"{recording.path}: nothing was drawn in this session (display.show was none)"
        )
    wanted = recording.manifest.parts[0].number if part is None else part
    drawn = of_part(recording, "drawn", wanted)
    at = np.flatnonzero(drawn["frame"] == frame)
    if not len(at) or not drawn["drawn"][at[0]]:
        numbers = drawn["frame"][drawn["drawn"]]
        known = f"{numbers[0]} to {numbers[-1]}" if len(numbers) else "none"
        raise UsageError(f"frame {frame} was not drawn in part {wanted}; drawn: {known}")
    row = _row(recording, "drawn", drawn, int(at[0]))
    views = of_part(recording, "drawn_views", wanted)
    latest = int(np.flatnonzero(views["t_host_ns"] <= drawn["t_host_ns"][at[0]])[-1])

    def shown(i: int) -> Shown:
        place, t_scene_ns = drawn["head_position_m"][i], int(drawn["t_scene_ns"][i])
        return shown_in(recording, wanted, int(drawn["frame"][i]), t_scene_ns, place)

    here = shown(int(at[0]))
    is_fading = here.scene.brightness_01 <= 0.0 < drawn["brightness_01"][at[0]]
    before = _last_lit(drawn["brightness_01"], int(at[0]), shown) if is_fading else None
    return RecordedFrame(
        tuple(study.views_of(here)),
        () if before is None else tuple(study.views_of(before)),
        row,
        _row(recording, "drawn_views", views, latest),
    )


def _last_lit(
    brightness_01: npt.NDArray[np.float32], at: int, shown: Callable[[int], Shown]
) -> Shown | None:
    """Return what was shown in the last lit frame before one whose light is going."""
    first = at
    while first > 0 and brightness_01[first - 1] >= brightness_01[first]:
        first -= 1
    rows = range(first, at)
    dark = bisect.bisect_left(rows, True, key=lambda i: shown(i).scene.brightness_01 <= 0.0)
    return shown(rows[dark - 1]) if dark else None


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
        picture_of,
        lambda: Renderer(quality=quality),
        Display(lambda: views, lambda: size_px, people),
        SimClock(),
    )
    try:
        return stage.redraw(found.views_shown, found.drawn, found.views_lit)
    finally:
        stage.close()


def _row(recording: Recording, name: str, arrays: dict[str, Any], i: int) -> np.void:
    schema = recording.stream_schema(name)
    if schema is None:
        raise DataError(f"{recording.path}: stream {name} has no schema")
    row = np.zeros(1, schema.dtype)[0]
    for field in schema.fields:
        row[field.name] = arrays[field.name][i]
    return row  # type: ignore[no-any-return]  # an element of a structured array

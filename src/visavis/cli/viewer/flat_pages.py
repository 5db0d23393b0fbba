"""Flat stimuli of a page in a browser as the viewer holds them: on its window as on a monitor."""

import json
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.flat import Showing, flat_content, words_of_files
from visavis.cli.viewer.models import Models
from visavis.cli.viewer.moving import PictureFiles
from visavis.cli.viewer.scenes import SAMPLES_PER_S, Sample, Times, scene_content
from visavis.lab.clock import NS_PER_S
from visavis.recording.cached import CachedRecording
from visavis.running.page.flat import ASSUMED
from visavis.running.page.seen_trial import SeenPart, SeenTrial
from visavis.stimuli.areas import PictureAreas
from visavis.stimuli.dressing.flat import areas_of
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.room_areas import RoomAreas
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import FlatScene
from visavis.study.area_measures import areas_shown, pointer_windows
from visavis.study.measures import TrialRecord


def flat_page_scenes(
    recording: CachedRecording,
    trial: SeenTrial,
    models: Models,
    bundle: Bundle,
    times: Times,
    changed: Collection[str] = (),
) -> list[dict[str, Any]]:
    """Return the scenes of a trial's flat stimuli, in order; what the recording lacks of one is
    said in its `notes`, and which of its files are among those that `changed` since.
    """
    record = TrialRecord(trial.row, recording)
    return [
        _scene(record, part, _names_by_onset(trial.row), models, bundle, times, changed)
        for step in trial.steps
        for part in step.parts
        if part.off_ns > part.on_ns
    ]


def _names_by_onset(row: Mapping[str, Any]) -> dict[int, str]:
    """Return the prefix of the columns of what was shown, by its onset (ns)."""
    return {
        int(t_ns): column.removesuffix("_on_ns")
        for column, t_ns in row.items()
        if column.endswith("_on_ns") and f"{column.removesuffix('_on_ns')}_frames" in row
        if t_ns is not None and t_ns == t_ns
    }


def _scene(
    record: TrialRecord,
    part: SeenPart,
    names_by_onset: Mapping[int, str],
    models: Models,
    bundle: Bundle,
    times: Times,
    changed: Collection[str],
) -> dict[str, Any]:
    notes = [_words_of_window(part), *words_of_files(part.scene, changed)]
    name = names_by_onset.get(part.scene.moves_since_ns, "")
    areas, is_recorded = _areas(record, name, part.scene)
    if areas and not is_recorded:
        notes.append("areas of interest: by the study's files today")
    samples = _samples(part, areas)
    part_number = int(record.row["recording_part"])
    trial_id = str(record.row["trial_id"])
    content = scene_content(trial_id, part_number, samples, part.off_ns, models, bundle, times)
    showing = samples[0].showing
    assert showing is not None  # noqa: S101 - made above
    t_ns, pictures = [s.t_ns for s in samples], [s.picture for s in samples]
    moving = [s.moving for s in samples]
    flat = flat_content(showing, t_ns, pictures, models, bundle, moving)
    flat["notes"] = notes
    if name:
        flat |= _window(record, name, part, bundle, times, part_number)
    return {**content, "flat": flat}


def _words_of_window(part: SeenPart) -> str:
    page = part.page
    assumptions = [
        what
        for what, by in (("screen's size", page.size_by), ("distance", page.distance_by))
        if by == ASSUMED
    ]
    scale = f"{page.px_per_deg:.1f} px per degree"
    if assumptions:
        scale += f", {' and '.join(assumptions)} assumed"
    if part.window_px is None:
        return f"{scale}; the window's size was not recorded: its edges are not drawn"
    wide, high = part.window_px
    return f"window {wide} × {high} px; {scale}"


def _areas(
    record: TrialRecord, name: str, scene: FlatScene
) -> tuple[tuple[PictureAreas, ...], bool]:
    """Return the areas of interest of what was shown, and whether the recording has them."""
    areas_recorded = areas_shown(record, name) if name else ()
    areas = tuple(one for one in areas_recorded if not isinstance(one, RoomAreas))
    return (areas, True) if areas else (areas_of(scene), False)


def _samples(part: SeenPart, areas: Sequence[PictureAreas]) -> list[Sample]:
    """Return what was shown at even times of a part; once where nothing of it changes."""
    scene = part.scene
    is_still = not scene.moves and scene.panorama is None
    step_ns = part.off_ns - part.on_ns if is_still else NS_PER_S // SAMPLES_PER_S
    showing = Showing(scene, tuple(areas), has_edges=part.window_px is not None)
    nobody, files, samples = (np.zeros((0, 3)), np.zeros(0)), PictureFiles(), []
    for t_ns in range(part.on_ns, part.off_ns, step_ns):
        frame = SceneFrame(scene, t_ns, *nobody, turned_deg=scene.turns.at(t_ns))
        picture, moving = files.of(picture_of(frame), showing.boxes)
        samples.append(Sample(t_ns, picture, (), picture, showing, moving))
    return samples


def _window(
    record: TrialRecord, name: str, part: SeenPart, bundle: Bundle, times: Times, number: int
) -> dict[str, Any]:
    """Return where the window after the pointer was: since when, and its middle on the screen."""
    events = pointer_windows(record, name)
    if not events:
        return {}
    event = events[-1]
    path = np.array(json.loads(event["path"]), np.float64).reshape(-1, 3)
    screen = part.screen
    towards = screen.directions_of(path[:, 1:])
    at_m = towards * (screen.distance_m / -towards[:, 2:])
    window_deg = float(event["window_deg"])
    return {
        "window": {
            "deg": window_deg,
            "isAround": False,
            "radius": float(screen.distance_m * np.radians(window_deg) / 2),
            "t": bundle.add(np.array([times.s(number, int(t)) for t in path[:, 0]])),
            "at": bundle.add(at_m.astype(np.float32)),
        }
    }

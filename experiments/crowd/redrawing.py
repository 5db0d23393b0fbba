"""Rebuild what a frame of a walk showed from its recording, so that it can be drawn again."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from visavis.experiments.crowd.walks import crowd_from_record
from visavis.lab.errors import DataError
from visavis.protocol.plan.shown_scene import RecordedScene
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.station_crowd import EMPTY_STATION, CrowdScene, can_read, station_frame


def views_of(shown: RecordedScene) -> Iterator[SceneFrame]:
    """Yield the views that a frame may have shown, the likeliest first.

    Raises:
        DataError: the crowd that was shown was not recorded.
    """
    name = str(shown.description["scene_name"])
    if name == EMPTY_STATION.name:
        yield station_frame(EMPTY_STATION, shown.t_scene_ns)
        return
    if not name.startswith("station_"):
        yield shown.view
        return
    crowd_event = shown.latest("crowd")
    if crowd_event is None:
        raise DataError(f"{shown.recording.path}: a crowd was shown, but no event 'crowd' recorded")
    scene = shown.once(("crowd", name, crowd_event[0]), lambda: _scene(name, crowd_event[1]))
    on = shown.latest("scene_on")
    if on is None or on[0] < shown.since_ns:
        yield station_frame(scene, shown.t_scene_ns)
        return
    board_event = shown.latest("board_on")
    x, _, z = shown.head_m.tolist()
    track = None
    if board_event is not None and board_event[0] >= on[0] and can_read(x, z):
        track = str(board_event[1]["track"])
    yield station_frame(scene, shown.t_scene_ns, shown.t_ns - on[0], track)
    # After the walk's last frame the crowd stands still until the next scene.
    end_ns = shown.once(("end of walk", on[0]), lambda: _end_ns(shown, on[0]))
    if end_ns is None:
        return
    times = shown.recording.stream_arrays("frames", part=shown.part)["t_host_ns"]
    before = int(np.searchsorted(times, min(shown.t_ns, end_ns)))
    if before:
        yield station_frame(scene, shown.t_scene_ns, int(times[before - 1]) - on[0], track)


def _scene(name: str, crowd_event: Mapping[str, Any]) -> CrowdScene:
    configuration = int(name.removeprefix("station_"))
    crowd = crowd_from_record(configuration, str(crowd_event["people"]))
    return CrowdScene(name, agents=(), crowd=crowd)


def _end_ns(shown: RecordedScene, on_ns: int) -> int | None:
    """Return when the walk that began then ended; None where it has no row."""
    trials = shown.recording.trials()
    if not len(trials):
        return None
    ends_ns = trials["t_end_ns"][trials["t_start_ns"] == on_ns]
    return int(ends_ns.iloc[-1]) if len(ends_ns) else None

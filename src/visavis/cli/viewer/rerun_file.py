"""A session for the Rerun viewer: the same times, people, gaze, body and columns as on the page.

People stand there as the bones that move them; Rerun does not draw meshes that bones move.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from visavis.cli.recorded_trial import RecordedTrial, recorded_trial
from visavis.cli.session_lanes import lanes_of
from visavis.cli.viewer.content import samples_of, times_of
from visavis.cli.viewer.scenes import Sample
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector
from visavis.recording.cached import CachedRecording
from visavis.recording.reader import flat_components
from visavis.results.opened_study import OpenedStudy
from visavis.running.page.seen_trial import is_on_page
from visavis.stimuli.characters.character import Character
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Room
from visavis.stimuli.surfaces import Surfaces

TIMELINE: Final = "session"
MAX_GAZE_M: Final = 50.0


def write_rerun(
    study: OpenedStudy,
    recording: CachedRecording,
    trial_ids: Sequence[str],
    path: Path,
    on_trial: Callable[[int, int], None] | None = None,
) -> None:
    """Write a session as a file of Rerun (.rrd); `trial_ids` are the trials that it shows in space.

    Raises:
        UsageError: Rerun is not installed, or the session has no such trial or no space.
    """
    try:
        import rerun as rr
    except ModuleNotFoundError as error:
        raise UsageError(
            "the file of Rerun needs rerun-sdk, which is not installed; run: pip install "
            "'visavis[rerun]'"
        ) from error
    if is_on_page(recording):
        raise UsageError(
            f"{recording.path} was recorded on a page, where nothing is in space; leave --rerun out"
        )
    manifest = recording.manifest
    name = f"visavis_{manifest.study}" + ("_simulated" if recording.is_simulated else "")
    session = f"{manifest.study} {manifest.participant} session {manifest.session}"
    with rr.RecordingStream(name, recording_id=f"{session} {manifest.seed}") as stream:
        stream.save(path)
        stream.log("/", rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True)
        times = times_of(recording)
        for part in recording.manifest.parts:
            _events(rr, stream, recording, part.number, times.s)
        for name_of_stream in recording.stream_names:
            _columns(rr, stream, recording, name_of_stream, times.s)
        for k, name_of_trial in enumerate(trial_ids):
            trial = recorded_trial(recording, name_of_trial)
            _trial(rr, stream, trial, samples_of(study, trial), times.s)
            if on_trial is not None:
                on_trial(k + 1, len(trial_ids))


def _at(rr: Any, stream: Any, seconds: float) -> None:
    stream.set_time(TIMELINE, duration=seconds)


def _events(
    rr: Any, stream: Any, recording: CachedRecording, part: int, s: Callable[[int, int], float]
) -> None:
    for event in recording.journal(part).events:
        if event["name"] == "scene":
            continue
        _at(rr, stream, s(part, int(event["t_ns"])))
        stream.log("events", rr.TextLog(f"{event['name']} {event['payload']}"))
    for lane in lanes_of(recording, part):
        for begin_ns, end_ns, text in lane.spans:
            for t_ns, what in ((begin_ns, 1.0), (end_ns, 0.0)):
                _at(rr, stream, s(part, t_ns))
                stream.log(f"felt/{lane.name.replace(' ', '_')}", rr.Scalars([what]))
            _at(rr, stream, s(part, begin_ns))
            stream.log("events", rr.TextLog(f"{lane.name} {text}"))


def _columns(
    rr: Any, stream: Any, recording: CachedRecording, name: str, s: Callable[[int, int], float]
) -> None:
    """Send every column of numbers of a stream."""
    arrays = recording.stream_arrays(name)
    if not len(arrays.get("seq", ())):
        return
    parts = arrays["recording_part"]
    seconds = np.array([s(int(p), int(t)) for p, t in zip(parts, arrays["t_host_ns"], strict=True)])
    for field, values in arrays.items():
        if field in ("seq", "t_host_ns", "t_device_ns", "recording_part"):
            continue
        if values.dtype.kind not in "fiub":
            continue
        for flat, column in flat_components(field, values):
            stream.send_columns(
                f"streams/{name}/{flat}",
                indexes=[rr.TimeColumn(TIMELINE, duration=seconds)],
                columns=rr.Scalars.columns(scalars=column.astype(np.float64)),
            )


def _trial(
    rr: Any,
    stream: Any,
    trial: RecordedTrial,
    samples: Sequence[Sample],
    s: Callable[[int, int], float],
) -> None:
    """Log a trial in space: its room, everybody's bones, heads to be looked at, the participant."""
    room: Room | None = None
    surfaces = Surfaces()
    for sample in samples:
        _at(rr, stream, s(trial.part, sample.t_ns))
        picture = sample.picture
        if picture.room is not room:
            room = picture.room
            _room(rr, stream, room)
        is_lit = picture.brightness_01 > 0
        bones = [
            line
            for i, character in enumerate(picture.cast if is_lit else ())
            for line in _bones(
                character, picture.people.root_m[i], picture.people.orientation_wxyz[i]
            )
        ]
        stream.log("world/people", rr.LineStrips3D(bones, radii=0.02))
        agents = sample.agents if is_lit else ()
        stream.log(
            "world/areas",
            rr.Ellipsoids3D(
                centers=[a.head_centre_m for a in agents],
                half_sizes=[[a.head_radius_m] * 3 for a in agents],
                labels=[a.place or a.agent_id for a in agents],
            ),
        )
        head = trial.head_at(sample.t_ns)
        w, x, y, z = head.orientation_wxyz.tolist()
        turn = rr.Quaternion(xyzw=[x, y, z, w])
        stream.log(
            "world/participant", rr.Transform3D(translation=head.position_m, quaternion=turn)
        )
        gaze = trial.gaze_at(sample.t_ns)
        origins = [] if gaze is None else [gaze[0]]
        vectors = (
            [] if gaze is None else [min(surfaces.end_m(picture, *gaze), MAX_GAZE_M) * gaze[1]]
        )
        stream.log("world/gaze", rr.Arrows3D(origins=origins, vectors=vectors))
        _body(rr, stream, trial, sample.t_ns)
    _at(rr, stream, s(trial.part, trial.span_ns[1]))
    for path in ("world/people", "world/areas", "world/gaze"):
        stream.log(path, rr.Clear(recursive=True))


def _room(rr: Any, stream: Any, room: Room) -> None:
    for k, prop in enumerate(room.props):
        mesh = prop.mesh
        stream.log(
            f"world/room/{k}",
            rr.Mesh3D(
                vertex_positions=mesh.vertices_m,
                triangle_indices=mesh.triangles,
                vertex_normals=mesh.normals,
                vertex_colors=mesh.colour_srgb,
            ),
        )


def _bones(character: Character, root_m: Vector, turns: Vector) -> list[Vector]:
    """Return a line (2, 3) from every joint to that above it."""
    skeleton = character.skeleton
    joints_m = forward(skeleton, root_m, turns).position_m
    return [
        np.stack([joints_m[parent], joints_m[joint]])
        for joint, parent in enumerate(skeleton.parents)
        if parent >= 0
    ]


def _body(rr: Any, stream: Any, trial: RecordedTrial, t_ns: int) -> None:
    if "body" not in trial.recording.stream_names:
        return
    body = trial.recording.stream_arrays("body", part=trial.part)
    i = int(np.searchsorted(body["t_host_ns"], t_ns, side="right")) - 1
    if i < 0 or t_ns - int(body["t_host_ns"][i]) > NS_PER_S // 5:
        return
    places = body["position_m"][i][body["valid"][i]]
    stream.log("world/body", rr.Points3D(places, radii=0.04))

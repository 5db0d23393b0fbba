"""What a page about a session holds: its time line, its streams, and its trials in space."""

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from visavis.analysis.session_check import check_session
from visavis.cli.film.cameras import Cuts, TopologyCamera, style_of
from visavis.cli.film.stand_in import StandIn, posture_of, resting_joints, somebody_else
from visavis.cli.recorded_trial import RecordedTrial, factors_of, recorded_trial, trial_row
from visavis.cli.session_lanes import lanes_of
from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.fixations import fixations_of
from visavis.cli.viewer.flat import (
    flat_content,
    flat_ends,
    onsets_ns,
    showing_of,
    words_of_files,
)
from visavis.cli.viewer.flat_pages import flat_page_scenes
from visavis.cli.viewer.models import LEVEL_OF_FEW, LEVEL_OF_MANY, MAX_FEW, Models
from visavis.cli.viewer.moving import PictureFiles
from visavis.cli.viewer.pages import pages_of
from visavis.cli.viewer.scenes import SAMPLES_PER_S, Sample, Times, scene_content
from visavis.devices.streams import NO_DEVICE_TIME
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DesignError
from visavis.lab.eye_height import MIN_EYE_M
from visavis.lab.geometry import Vector, rotate
from visavis.lab.schema import Field
from visavis.recording.cached import CachedRecording
from visavis.recording.manifest import MANIFEST_NAME
from visavis.recording.reader import flat_components
from visavis.results.opened_study import OpenedStudy
from visavis.running.page.seen_trial import is_on_page, seen_trial
from visavis.stimuli.camera.shots import ShotSize
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.moving_heads import agents_at
from visavis.stimuli.picture import Picture
from visavis.stimuli.surfaces import Surfaces
from visavis.study.files_read import changed_files

GAP_S: Final = 2.0
"""What stands on the time line between two parts of a session."""
MAX_ROWS: Final = 60_000
MAX_ROWS_OF_WIDE: Final = 12_000
WIDE: Final = 60
"""Streams of more columns than this are thinned more; the page says which rows it has."""
AROUND_NS: Final = NS_PER_S
"""Margin around a shown trial within which every row is kept."""
MAX_TEXT: Final = 400
PACKED_BYTES: Final = 60_000_000
"""Of a page's arrays: later trials are files beside it, loaded when they are looked at."""
TOLD_ELSEWHERE: Final = frozenset(
    "recording_part participant participant_index session group part trial_id status attempt "
    "is_practice".split()
)
"""Columns of a trial that the page says in other words."""


def page_content(
    study: OpenedStudy,
    recording: CachedRecording,
    trial_ids: Sequence[str],
    on_trial: Callable[[int, int], None] | None = None,
    beside: Callable[[str, str], str] | None = None,
) -> tuple[dict[str, Any], Bundle]:
    """Return a page's header and arrays; `trial_ids` are the trials it shows in space.

    With `beside`, trials and pictures of films that no longer fit into the page are given to it one
    by one: a name and the text of a bundle; it returns the place that the page loads it from.

    Raises:
        UsageError: the session has no such trial.
    """
    bundle = Bundle()
    times = times_of(recording)
    on_page = is_on_page(recording)
    models: Models | None = None
    contents, pages, films = [], list[dict[str, Any]](), list[dict[str, Any]]()
    problems: dict[str, str] = {}
    changed = changed_files(recording.manifest.configuration, study.study.files.trial_folder)
    if on_page:
        models = models_for(bundle, [], beside)
        trials_again = [
            seen_trial(study, recording, trial_row(recording, name)) for name in trial_ids
        ]
        pages, films = pages_of(trials_again, models, times.s, on_trial)
        scenes = [
            flat_page_scenes(recording, trial, models, bundle, times, changed)
            for trial in trials_again
        ]
        problems = {
            str(trial.row["trial_id"]): trial.problem for trial in trials_again if trial.problem
        }
        contents = [{"scenes": own, "gazeEnds": [], "fixations": []} for own in scenes]
    trials = [] if on_page else [recorded_trial(recording, name) for name in trial_ids]
    in_space = InSpace(study, recording, times)
    places: dict[str, str] = {}
    # Samples of a long trial with many people are large: one trial's are held at a time.
    for k, trial in enumerate(trials):
        samples = in_space.samples(trial)
        models = models or models_for(bundle, samples, beside)
        name = str(trial.row["trial_id"])
        if beside is None or bundle.size < PACKED_BYTES:
            contents.append(in_space.content(trial, samples, models, bundle))
        else:
            own = Bundle()
            content = in_space.content(trial, samples, models, own)
            places[name] = beside(name, own.text(content))
            contents.append(_without_arrays(content))
        if on_trial is not None:
            on_trial(k + 1, len(trials))
    models = models or models_for(bundle, [])
    return {
        **whose(recording),
        **_join(contents),
        "rest": at_rest(study, recording, trials),
        "parts": [
            {
                "number": part.number,
                "t0": times.s(part.number, part.started_ns),
                "started_ns": part.started_ns,
            }
            for part in recording.manifest.parts
        ],
        "trials": [
            {**row, "beside": places.get(row["id"]), "problem": problems.get(row["id"])}
            if row["shown"]
            else {**row, "beside": None, "problem": None}
            for row in _trials(recording, times, set(trial_ids))
        ],
        "events": list(_events(recording, times)),
        "findings": _findings(recording),
        "lanes": _lanes(recording, times, list(times.offset_s)),
        "streams": [
            _stream(recording, name, bundle, times, trials) for name in recording.stream_names
        ],
        "pages": pages,
        "films": films,
        **models_content(models),
    }, bundle


class InSpace:
    """The trials of a session as they are packed, one after the other."""

    def __init__(self, study: OpenedStudy, recording: CachedRecording, times: Times) -> None:
        self._study, self._recording, self._times = study, recording, times
        self._stand_ins: StandIns = {}
        configuration = recording.manifest.configuration
        self._changed_files = changed_files(configuration, study.study.files.trial_folder)

    def samples(self, trial: RecordedTrial) -> "list[Sample]":
        """Return what was shown in a trial, with the participant in it."""
        samples = samples_of(self._study, trial)
        return with_participant(self._study, trial, samples, self._stand_ins)

    def content(
        self, trial: RecordedTrial, samples: "list[Sample]", models: Models, bundle: Bundle
    ) -> dict[str, Any]:
        """Return a trial's scenes, ends of gaze and fixations; their arrays go into a bundle."""
        scenes = []
        for run, end_ns in _runs(samples):
            name, first = str(trial.row["trial_id"]), run[0]
            scene = scene_content(name, trial.part, run, end_ns, models, bundle, self._times)
            scene["topology"] = _topology(trial, run, bundle)
            if first.showing is not None:
                t_ns, pictures = [s.t_ns for s in run], [s.picture for s in run]
                moving = [s.moving for s in run]
                flat = flat_content(first.showing, t_ns, pictures, models, bundle, moving)
                scene["flat"] = flat
                scene["flat"]["notes"] = words_of_files(first.showing.scene, self._changed_files)
            scenes.append(scene)
        gaze = _gaze(self._recording, trial, samples, models.level, bundle, self._times)
        return {"scenes": scenes, **gaze}


def _join(contents: Sequence[Mapping[str, list[Any]]]) -> dict[str, list[Any]]:
    """Return scenes, ends of gaze and fixations of all trials."""
    names = ("scenes", "gazeEnds", "fixations")
    return {name: [one for content in contents for one in content[name]] for name in names}


def _without_arrays(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a page says of a trial before its file beside the page is loaded."""
    names = ("trial", "t0", "t1", "agents")
    stubs = [{**{n: scene[n] for n in names}, "isBeside": True} for scene in content["scenes"]]
    return {"scenes": stubs, "gazeEnds": [], "fixations": content["fixations"]}


def models_for(
    bundle: Bundle,
    samples: "Sequence[Sample]",
    beside: Callable[[str, str], str] | None = None,
) -> Models:
    """Return the models of a page; many people in one place are drawn at their lightest."""
    most = max((len(s.full_picture.cast) for s in samples), default=0)
    level = LEVEL_OF_FEW if most <= MAX_FEW else LEVEL_OF_MANY
    return Models(bundle, level=level, beside=beside)


def models_content(models: Models) -> dict[str, Any]:
    """Return the part of a header that says what scenes are drawn with."""
    models.write_piece()
    return {
        "people": models.people,
        "rooms": models.rooms,
        "textures": models.textures,
        "pieces": models.pieces,
    }


def whose(recording: CachedRecording) -> dict[str, Any]:
    """Return the part of a header that says whose session it is."""
    manifest = recording.manifest
    return {
        "study": manifest.study,
        "participant": manifest.participant,
        "session": manifest.session,
        "simulated": recording.is_simulated,
        "status": recording.status,
        "created": manifest.created_wall_iso,
        "seed": manifest.seed,
        "sha256": hashlib.sha256((recording.path / MANIFEST_NAME).read_bytes()).hexdigest(),
        "version": manifest.provenance.packages.get("visavis", ""),
    }


def trial_content(
    recording: CachedRecording, trial: RecordedTrial, bundle: Bundle, times: Times
) -> dict[str, Any]:
    """Return a header's part about one trial alone: its row, events, lanes and rows of streams."""
    name = str(trial.row["trial_id"])
    begin_s, end_s = (times.s(trial.part, t_ns) for t_ns in trial.span_ns)
    rows = [row for row in _trials(recording, times, {name}) if row["shown"]]
    lanes = _lanes(recording, times, [trial.part])
    return {
        "trials": rows,
        "events": [
            event
            for event in _events(recording, times)
            if event["part"] == trial.part and begin_s <= event["t"] <= end_s
        ],
        "findings": None,
        "lanes": [
            {**lane, "spans": [s for s in lane["spans"] if s[1] >= begin_s and s[0] <= end_s]}
            for lane in lanes
        ],
        "streams": [
            _stream(recording, stream, bundle, times, [trial], alone=True)
            for stream in recording.stream_names
        ],
        "pages": [],
        "films": [],
    }


def at_rest(
    study: OpenedStudy, recording: CachedRecording, trials: Sequence[RecordedTrial]
) -> dict[str, Any] | None:
    """Return the joints of a participant whose body was not measured, in the study's posture.

    Who sits keeps the turn of their first head pose, `yaw_rad`; who stands turns with the head.
    """
    if not trials or "body" in recording.stream_names:
        return None
    head = trials[0].head_at(trials[0].span_ns[0])
    eye_height_m = float(head.position_m[1])
    if not MIN_EYE_M < eye_height_m:  # measured from somewhere else than the floor
        return None
    posture = study.study.procedure.posture or posture_of(eye_height_m)
    joints = resting_joints(eye_height_m, posture)
    facing = rotate(head.orientation_wxyz, np.array([0.0, 0.0, -1.0]))
    yaw_rad = float(np.arctan2(-facing[0], -facing[2]))
    return {
        "joints": {name: [round(float(v), 4) for v in at] for name, at in joints.items()},
        "yaw_rad": round(yaw_rad, 4) if posture == "seated" else None,
    }


def trial_lengths_ns(recording: CachedRecording) -> dict[str, int]:
    """Return the length in ns of the last attempt at every trial that ended, in order."""
    rows = recording.trials()
    if "trial_id" not in rows:
        return {}
    ended_rows = rows[rows["t_end_ns"].notna() & rows["t_start_ns"].notna()]
    return {
        str(row["trial_id"]): int(row["t_end_ns"]) - int(row["t_start_ns"])
        for row in ended_rows.to_dict("records")
    }


# ---- time line --------------------------------------------------------------------------------


def times_of(recording: CachedRecording) -> Times:
    """Return where every part of a session lies on one line of seconds that begins at 0.

    Session times of a real clock count from the computer's start. What waited on a page while its
    server began anew is earlier than the part that holds it.
    """
    offset_s, begun_s = {}, 0.0
    for part in recording.manifest.parts:
        events = recording.journal(part.number).events
        first_ns = part.started_ns
        last_ns = max((int(e["t_ns"]) for e in events), default=first_ns)
        for name in recording.stream_names:
            t_ns = recording.stream_arrays(name, part=part.number).get("t_host_ns")
            if t_ns is not None and len(t_ns):
                first_ns, last_ns = min(first_ns, int(t_ns[0])), max(last_ns, int(t_ns[-1]))
        offset_s[part.number] = begun_s - first_ns / NS_PER_S
        begun_s += (last_ns - first_ns) / NS_PER_S + GAP_S
    return Times(offset_s)


def _trials(
    recording: CachedRecording, times: Times, ids_on_page: set[str]
) -> Iterator[dict[str, Any]]:
    rows = recording.trials()
    if "trial_id" not in rows:
        return
    last_of = {str(name): i for i, name in enumerate(rows["trial_id"])}
    for i, row in enumerate(rows.to_dict("records")):
        name, part = str(row["trial_id"]), int(row["recording_part"])
        if any(row[n] is None or row[n] != row[n] for n in ("t_start_ns", "t_end_ns")):
            continue
        yield {
            "id": name,
            "t0": times.s(part, int(row["t_start_ns"])),
            "t1": times.s(part, int(row["t_end_ns"])),
            "status": str(row.get("status", "")),
            "practice": bool(row.get("is_practice", False)),
            "attempt": int(row.get("attempt", 1)),
            "factors": {f: _plain(row[f]) for f in factors_of(recording, name) if f in row},
            "row": [
                [*_fact(str(k), _plain(v), row, times), str(_plain(v))]
                for k, v in row.items()
                if k not in TOLD_ELSEWHERE and k not in factors_of(recording, name)
            ],
            "shown": name in ids_on_page and last_of[name] == i,
        }


def _fact(name: str, value: Any, row: Mapping[Any, Any], times: Times) -> tuple[str, Any]:
    """Return a value of a trial's row as people read it: instants in the trial on the page's line
    of seconds, other times in ms, names in words. Missing stays None.
    """
    plain_name = name.removeprefix("t_").removesuffix("_ns").replace("_", " ")
    if not name.endswith("_ns"):
        return name.replace("_", " "), value.replace("_", " ") if isinstance(value, str) else value
    if value is None:
        return plain_name, None
    if row["t_start_ns"] <= value <= row["t_end_ns"]:
        return plain_name, {"at": times.s(int(row["recording_part"]), int(value))}
    return f"{plain_name} (ms)", value / NS_PER_MS


def _events(recording: CachedRecording, times: Times) -> Iterator[dict[str, Any]]:
    for event in recording.events().to_dict("records"):
        part, t_ns, name, payload = (
            event[k] for k in ("recording_part", "t_ns", "name", "payload")
        )
        text = "" if name == "scene" else json.dumps(payload, ensure_ascii=False, default=str)
        if len(text) > MAX_TEXT:
            text = text[:MAX_TEXT] + " …"
        yield {"t": times.s(part, int(t_ns)), "part": part, "name": name, "text": text}


def _findings(recording: CachedRecording) -> list[dict[str, Any]]:
    verdict = check_session(recording)
    return [
        {"level": f.level.name.lower(), "subject": f.subject, "message": f.message, "redo": f.redo}
        for f in verdict.findings
    ]


def _lanes(recording: CachedRecording, times: Times, parts: Sequence[int]) -> list[dict[str, Any]]:
    """Return what touched and what vibrated, all these parts in one lane."""
    lane_by_name: dict[str, dict[str, Any]] = {}
    for part in parts:
        for lane in lanes_of(recording, part):
            empty_lane = {"name": lane.name, "kind": lane.kind, "role": lane.role, "spans": []}
            lane_by_name.setdefault(lane.name, empty_lane)["spans"] += [
                [times.s(part, a), times.s(part, b), text] for a, b, text in lane.spans
            ]
    return list(lane_by_name.values())


def _plain(value: Any) -> Any:
    """Return a row's value as JSON has it; what is missing is None."""
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


# ---- streams ----------------------------------------------------------------------------------


def _stream(
    recording: CachedRecording,
    name: str,
    bundle: Bundle,
    times: Times,
    trials: Sequence[RecordedTrial],
    *,
    alone: bool = False,
) -> dict[str, Any]:
    """Pack a stream: all rows, or every n-th row and all rows of the shown trials; or these
    trials `alone`.
    """
    arrays = recording.stream_arrays(name)
    schema = recording.stream_schema(name)
    fields = () if schema is None else schema.fields
    width = sum(int(np.prod(f.shape)) for f in fields)
    n = len(arrays["recording_part"])
    every = max(1, -(-n // (MAX_ROWS_OF_WIDE if width > WIDE else MAX_ROWS)))
    is_kept = np.zeros(n, bool) if alone else np.arange(n) % every == 0
    when_ns = _when_ns(name, arrays)
    inside = np.zeros(n, bool)
    for trial in trials if every > 1 or alone else ():
        start_ns, end_ns = trial.span_ns
        inside |= (
            (arrays["recording_part"] == trial.part)
            & (when_ns >= start_ns - AROUND_NS)
            & (when_ns < end_ns + AROUND_NS)
        )
    # Wide streams of very long sessions are thinned in trials, too, others never.
    many = int(np.count_nonzero(inside))
    every_inside = max(1, -(-many // MAX_ROWS)) if width > WIDE else 1
    is_kept |= inside & (np.arange(n) % every_inside == 0)
    part, host_ns, when_ns = (
        a[is_kept] for a in (arrays["recording_part"], arrays.get("t_host_ns", when_ns), when_ns)
    )
    t_s = np.array([times.s(int(p), int(t)) for p, t in zip(part, when_ns, strict=True)])
    columns = []
    for field in fields:
        values = arrays[field.name][is_kept]
        unit = field.unit
        if unit == "ns":
            values, unit = _since_arrival_ms(values, host_ns), "ms"
        flat = [
            _column_name(field, component) for component, _ in flat_components(field.name, values)
        ]
        columns.append(
            {
                "name": field.name,
                "of": flat,
                "labels": _labels(field, flat),
                "unit": unit,
                "about": field.description,
                "v": (
                    bundle.add_whole(values)
                    if values.dtype.kind in "biu"
                    else bundle.add_quantised(values)
                ),
            }
        )
    micros = np.rint(1e6 * t_s).astype(np.int64)
    return {
        "name": name,
        "t": bundle.add(np.diff(micros, prepend=0).astype(np.int32)),
        "every": every,
        "everyInside": every_inside if every > 1 or alone else 1,
        "rows": n,
        "columns": columns,
    }


def _when_ns(name: str, arrays: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[Any]:
    """Return when the rows of a stream were measured or, where it does not say, arrived."""
    when_ns = arrays.get("t_host_ns", np.zeros(len(arrays["recording_part"])))
    if name == "gaze_targets":  # no later than it arrived, even if a tracker's clock slips
        when_ns = np.minimum(arrays["t_sample_ns"], when_ns)
    return when_ns


def _since_arrival_ms(values: npt.NDArray[Any], host_ns: npt.NDArray[Any]) -> Vector:
    """Return times of a row as milliseconds after it arrived; unknown times are NaN."""
    is_known = (values != NO_DEVICE_TIME) & (values >= 0)
    apart: Vector = np.where(is_known, (values - host_ns) / NS_PER_MS, np.nan)
    return apart


def _labels(field: Field, names: Sequence[str]) -> list[str]:
    """Return what people call a field's columns: of several parts the part, then the axis."""
    unit = "ms" if field.unit == "ns" else field.unit if field.unit not in ("", "1") else ""
    ending = f" ({unit})" if unit else ""
    parts = field.description.partition(": ")[2].split()
    axes = ("w", "x", "y", "z") if field.name.endswith("_wxyz") else ("x", "y", "z")
    if len(field.shape) == 2 and len(parts) == field.shape[0] and len(axes) == field.shape[1]:
        return [f"{part.replace('_', ' ')} {axis}{ending}" for part in parts for axis in axes]
    stem = "after_ms" if field.unit == "ns" else f"_{field.unit}"
    return [name.removesuffix(stem).strip("_").replace("_", " ") + ending for name in names]


def _column_name(field: Field, flat: str) -> str:
    return f"{flat.removesuffix('_ns')}_after_ms" if field.unit == "ns" else flat


# ---- trials in space --------------------------------------------------------------------------


StandIns = dict[tuple[int, str], StandIn]
"""Who stands in for the participant, by part of the session and figure: one in many trials, so
that a page holds that figure once."""


def with_participant(
    study: OpenedStudy, trial: RecordedTrial, samples: Sequence[Sample], stand_ins: StandIns
) -> list[Sample]:
    """Return samples with the participant in their pictures, as films from outside show them.

    Whoever was measured from somewhere else than the floor has no figure.
    """
    if not samples or not MIN_EYE_M < float(trial.head_at(samples[0].t_ns).position_m[1]):
        return list(samples)
    key = trial.part, somebody_else(samples[0].picture).name
    person = stand_ins.setdefault(key, StandIn(trial, study.study.procedure.posture))
    return [
        replace(s, full_picture=person.in_picture(s.picture, s.t_ns, trial.head_at(s.t_ns)))
        for s in samples
    ]


def samples_of(study: OpenedStudy, trial: RecordedTrial) -> list[Sample]:
    """Return what was shown at even times of a trial; flat stimuli from their onset on."""
    start_ns, end_ns = trial.span_ns
    samples, files = [], PictureFiles()
    for begin_ns, until_ns in pairwise([start_ns, *onsets_ns(trial), end_ns + 1]):
        for t_ns in range(begin_ns, until_ns, NS_PER_S // SAMPLES_PER_S):
            moment = trial.shown_at(t_ns)
            view = next(iter(study.views_of(moment)))
            showing, agents = showing_of(view, moment), agents_at(view.scene, t_ns)
            boxes = () if showing is None else showing.boxes
            picture, moving = files.of(picture_of(view), boxes)
            samples.append(Sample(t_ns, picture, agents, picture, showing, moving))
    return samples


def _gaze(
    recording: CachedRecording,
    trial: RecordedTrial,
    samples: Sequence[Sample],
    level: int,
    bundle: Bundle,
    times: Times,
) -> dict[str, list[Any]]:
    """Return for every sample of gaze in a trial its time, how far away it ended, and on what:
    surfaces as the page draws them (`gazeEnds`); and the trial's `fixations`. In the dark gaze
    ends nowhere.
    """
    if "gaze_targets" not in recording.stream_names:
        return {"gazeEnds": [], "fixations": []}
    arrays = recording.stream_arrays("gaze_targets")
    when_ns, surfaces = _when_ns("gaze_targets", arrays), Surfaces(level)
    start_ns, end_ns = trial.span_ns
    rows = np.flatnonzero(
        (arrays["recording_part"] == trial.part) & (start_ns <= when_ns) & (when_ns <= end_ns)
    )
    rows = rows[np.argsort(when_ns[rows], kind="stable")]
    is_valid = arrays["valid"][rows].astype(bool)
    origin_m = arrays["origin_world_m"][rows].astype(np.float64)
    direction = arrays["direction_world"][rows].astype(np.float64)
    direction[~is_valid] = np.nan
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    far_m, on = np.full(len(rows), np.nan), np.full(len(rows), "", dtype=object)
    is_lit = np.zeros(len(rows), bool)
    # Of the samples of one showing the nearest.
    t_ns = np.array([sample.t_ns for sample in samples])
    ends_ns = np.where(np.isin(t_ns[1:], onsets_ns(trial)), t_ns[1:], (t_ns[:-1] + t_ns[1:]) // 2)
    nearest = np.searchsorted(ends_ns, when_ns[rows], side="right")
    for k in np.unique(nearest[is_valid]):
        here, sample = np.flatnonzero((nearest == k) & is_valid), samples[k]
        if sample.picture.brightness_01 <= 0:
            continue
        rays, showing = (origin_m[here], direction[here]), sample.showing
        if showing is None:
            ends = surfaces.ends(sample.picture, *rays)
        else:
            ends = flat_ends(surfaces, sample.picture, showing, *rays, when_ns[rows[here]])
        far_m[here], on[here], is_lit[here] = ends.distance_m, ends.name, True
    far_m[~np.isfinite(far_m)] = np.nan
    fixations = fixations_of(
        when_ns[rows],
        direction,
        origin_m + far_m[:, None] * direction,
        arrays["hit"][rows].astype(np.int64),
        on,
    )
    t_s = [times.s(trial.part, int(t)) for t in when_ns[rows[is_lit]]]
    micros = np.rint(1e6 * np.array(t_s)).astype(np.int64)
    kinds, number = np.unique(on[is_lit].astype(str), return_inverse=True)
    return {
        "gazeEnds": [
            {
                "t0": times.s(trial.part, start_ns),
                "t1": times.s(trial.part, end_ns),
                "t": bundle.add(np.diff(micros, prepend=0).astype(np.float64)),
                "far": bundle.add_quantised(far_m[is_lit][:, None]),
                "on": bundle.add(number.astype(np.uint16)),
                "names": kinds.tolist(),
            }
        ],
        "fixations": [
            {
                "t0": times.s(trial.part, one.pop("begin_ns")),
                "t1": times.s(trial.part, one.pop("end_ns")),
                **one,
            }
            for one in fixations
        ],
    }


def _runs(samples: list[Sample]) -> Iterator[tuple[list[Sample], int]]:
    """Yield samples that show the same people and things in the same room, and when these end."""

    def same(a: Sample, b: Sample) -> bool:
        return (
            a.picture.room is b.picture.room
            and a.showing is b.showing
            and len(a.full_picture.cast) == len(b.full_picture.cast)
            and all(
                one is two
                for one, two in zip(a.full_picture.cast, b.full_picture.cast, strict=True)
            )
            and [m.prop for m in a.picture.moving] == [m.prop for m in b.picture.moving]
            and a.picture.panels == b.picture.panels
            and [x.agent_id for x in a.agents] == [x.agent_id for x in b.agents]
        )

    cuts = [k for k in range(1, len(samples)) if not same(samples[k - 1], samples[k])]
    end_ns = samples[-1].t_ns + NS_PER_S // SAMPLES_PER_S
    for first, last in pairwise([0, *cuts, len(samples)]):
        yield samples[first:last], samples[last].t_ns if last < len(samples) else end_ns


def _topology(trial: RecordedTrial, samples: list[Sample], bundle: Bundle) -> dict[str, Any] | None:
    """Return where a camera that knows the room would film from, and at what; None in a room that
    has no such place.
    """
    if not samples[0].picture.room.props:
        return None
    start_ns = samples[0].t_ns

    def shown_at(t_ns: int) -> Picture:
        k = (t_ns - start_ns) * SAMPLES_PER_S // NS_PER_S
        return samples[min(max(k, 0), len(samples) - 1)].picture

    camera = TopologyCamera(style_of(ShotSize.LONG, Cuts.AUTO), 16 / 9, shown_at, trial.head_at)
    try:
        for sample in samples:
            camera.at(sample.t_ns, sample.picture, trial.head_at(sample.t_ns))
    except DesignError:
        return None
    decisions = camera.decisions()
    return {
        "views": bundle.add_quantised(np.array(decisions.views)[:, 1:]),
        "fov": decisions.fov_v_deg,
        "cuts": [round((cut["t_ns"] - start_ns) / NS_PER_S, 3) for cut in decisions.cuts],
    }

"""Evaluate recorded gaze again with the engine that evaluated it in the session.

Recordings without the stream `head_measured` were made when gaze was turned by the head foreseen
for the light of its frame, as if that were the head when the frame began. They can be evaluated
so (`Pairing.AS_RECORDED`), which repeats what they hold, or by the present time model, in which
every pose counts for the time that it describes (docs/decisions/0022).
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from enum import StrEnum
from typing import Any, Final

import numpy as np

from visavis.analysis.gaze.targets import gaze_delay_ns
from visavis.devices.streams import GAZE, HEAD, HEAD_MEASURED
from visavis.lab.clock import NS_PER_MS, NS_PER_S
from visavis.lab.errors import DataError, UsageError
from visavis.lab.geometry import Pose
from visavis.lab.schema import SampleBatch, StreamSchema, empty_values
from visavis.protocol.plan.shown_scene import RecordedScene, recorded_scene
from visavis.protocol.session.head_history import HeadHistory
from visavis.protocol.session.observation import GazeObserver
from visavis.protocol.session.row_buffer import RowBuffer
from visavis.recording.reader import PART_COLUMN, Recording
from visavis.recording.stream_file import Columns
from visavis.stimuli.scene import Scene, SceneFrame

TARGETS: Final = "gaze_targets"
ViewsOf = Callable[[RecordedScene], Iterator[SceneFrame]]
"""How a study says again what it showed."""


class Pairing(StrEnum):
    """At which times recorded poses of the head count."""

    OWN_TIME = "own time"
    """Each at the time that it describes."""
    AS_RECORDED = "as recorded"
    """As in the session: poses of older recordings when their frames began."""


def paired_by_arrival(recording: Recording, part: int) -> bool:
    """Tell whether a part's gaze was turned by poses that were of another moment."""
    if recording.manifest.configuration.get("screen"):
        return False
    names = recording.stream_names
    if HEAD_MEASURED.name in names or not {GAZE.name, TARGETS, HEAD.name} <= set(names):
        return False
    head = recording.stream_arrays(HEAD.name, part=part)
    return bool((head["t_device_ns"] != head["t_host_ns"])[head["valid"]].any())


def pair_by_own_time(recording: Recording, views_of: ViewsOf) -> bool:
    """Let a recording give `gaze_targets` in which gaze is turned by the head of its own time.

    Only parts are evaluated again in which it was turned by the head of another moment. The files
    stay as they are. Return whether there are such parts; a second call does nothing.
    """
    parts = [
        part.number
        for part in recording.manifest.parts
        if paired_by_arrival(recording, part.number)
    ]
    for number in parts:
        if not recording.is_amended(number, TARGETS):
            again = targets_again(recording, views_of, number, Pairing.OWN_TIME)
            recording.amend(number, TARGETS, again)
    return bool(parts)


def ahead_ms(recording: Recording) -> float:
    """Return how far the head was foreseen in a recording: the median over its frames."""
    head = recording.stream_arrays(HEAD.name)
    ahead_ns = (head["t_device_ns"] - head["t_host_ns"])[head["valid"]]
    return float(np.median(ahead_ns)) / NS_PER_MS


def targets_again(
    recording: Recording,
    views_of: ViewsOf,
    part: int,
    pairing: Pairing = Pairing.AS_RECORDED,
) -> Columns:
    """Feed the engine with a part's gaze, head and scenes, frame by frame; return `gaze_targets`.

    Poses of the head count at the times that `pairing` says. Heads of people who move are where
    the session took them to be: in older recordings where they were at the onset. The samples of
    each frame are as recorded. The offset of the tracker's clock is the trial's own within a trial,
    and as recorded between trials.

    Raises:
        UsageError: people sat before a screen; its place is not recorded.
        DataError: a sample that was evaluated is not in the recording.
    """
    if recording.manifest.configuration.get("screen"):
        raise UsageError(
            f"{recording.path} was recorded before a screen; only gaze in a headset is evaluated "
            "again"
        )
    recorded_targets = recording.stream_arrays(TARGETS, part=part)
    gaze, frames = (recording.stream_arrays(name, part=part) for name in (GAZE.name, "frames"))
    heads = _Heads(recording, part, pairing)
    schema = recording.stream_schema(TARGETS)
    if schema is None:
        raise DataError(f"{recording.path}: stream {TARGETS} has no schema")
    batches: list[SampleBatch] = []
    delay_ns = gaze_delay_ns(recording)
    targets = RowBuffer(schema, batches.append, hold_ns=NS_PER_S)
    observer = GazeObserver(targets, delay_ns=delay_ns)
    offsets_ns = _offsets_ns(recording, part)
    scenes = _Scenes(recording, views_of, part)
    place_of = {int(seq): i for i, seq in enumerate(gaze["seq"])}
    first_of, last_of = _runs(recorded_targets["frame_index"])
    frame_count = len(frames["frame_index"])
    for k in range(frame_count):
        until_ns = int(frames["t_host_ns"][k + 1]) if k + 1 < frame_count else None
        # The observer knew the head poses that had arrived before the next frame.
        heads.tell(observer.heads, until_ns)
        frame = int(frames["frame_index"][k])
        if frame not in first_of:
            continue
        # Evaluate the same gaze samples in this frame as the session did.
        rows = slice(first_of[frame], last_of[frame] + 1)
        try:
            at = [place_of[int(seq)] for seq in recorded_targets["gaze_seq"][rows]]
        except KeyError as error:
            raise DataError(
                f"{recording.path}: frame {frame} evaluated gaze sample {error}, which is not in "
                "the stream gaze"
            ) from error
        observer.show(scenes.in_frame(k))
        seen_ns = (
            int(recorded_targets["t_sample_ns"][rows][0])
            + delay_ns
            - int(gaze["t_device_ns"][at[0]])
        )
        # Use the clock offset of the trial, or the recorded one between trials.
        trial = int(frames["trial_number"][k])
        t_ns = int(frames["t_host_ns"][k])
        observer.clock_offset_ns = next(
            (o for number, a, b, o in offsets_ns if number == trial and a <= t_ns <= b), seen_ns
        )
        observer.take(_batch(recording, gaze, at))
        observer.observe(frame, t_ns)
    targets.flush()
    return _columns(schema, batches, part)


class _Heads:
    """The recorded poses of a part, handed out in order of arrival."""

    def __init__(self, recording: Recording, part: int, pairing: Pairing) -> None:
        names = recording.stream_names
        head = recording.stream_arrays(HEAD.name, part=part)
        self._foreseen: Columns | None = head
        self._measured: Columns | None = None
        if HEAD_MEASURED.name in names:
            self._measured = recording.stream_arrays(HEAD_MEASURED.name, part=part)
        elif pairing is Pairing.AS_RECORDED or not paired_by_arrival(recording, part):
            # the session took the poses of its frames for measured when they began
            self._foreseen = None
            self._measured = {**head, "t_device_ns": head["t_host_ns"]}
        self._foreseen_next = self._measured_next = 0

    def tell(self, history: HeadHistory, until_ns: int | None) -> None:
        """Add the poses that had arrived before a time; None: all."""
        if self._measured is not None:
            self._measured_next = _hand_out(
                self._measured, self._measured_next, until_ns, history.add_measured
            )
        if self._foreseen is not None:
            self._foreseen_next = _hand_out(
                self._foreseen, self._foreseen_next, until_ns, history.add_foreseen
            )


def _hand_out(
    head: Columns, first: int, until_ns: int | None, add: Callable[[int, Pose], None]
) -> int:
    """Add poses from a row on that arrived before a time; return the next row."""
    i = first
    while i < len(head["valid"]) and (until_ns is None or head["t_host_ns"][i] < until_ns):
        if head["valid"][i]:
            add(int(head["t_device_ns"][i]), _pose(head, i))
        i += 1
    return i


class _Scenes:
    """The scenes of a part, each made once, by the frame in which gaze was evaluated."""

    def __init__(self, recording: Recording, views_of: ViewsOf, part: int) -> None:
        self._recording, self._views_of, self._part = recording, views_of, part
        self._frames = recording.stream_arrays("frames", part=part)
        self._states = recording.stream_arrays("scene_states", part=part)
        self._scene_by_number: dict[int, Scene] = {}

    def in_frame(self, k: int) -> Scene:
        """Return the scene on display in the k-th frame."""
        number = int(self._states["scene"][int(self._frames["scene_row"][k])])
        if number not in self._scene_by_number:
            # A row tells what was drawn in the frame before.
            frame = int(self._frames["frame_index"][max(0, k - 1)])
            t_ns = int(self._frames["t_host_ns"][max(0, k - 1)])
            frame_content = recorded_scene(self._recording, self._part, frame, t_ns, np.zeros(3))
            view = next(iter(self._views_of(frame_content)))
            scene = view.scene
            if not frame_content.heads_move:
                scene = replace(scene, moved_by="")
            self._scene_by_number[number] = scene
        return self._scene_by_number[number]


def _offsets_ns(recording: Recording, part: int) -> list[tuple[int, int, int, int]]:
    """Return trial number, begin, end and the tracker's clock offset of every trial of a part."""
    offsets = []
    for entry in recording.trial_entries(part):
        row = entry["row"]
        if row.get("clock_offset_ns") is not None and row.get("t_start_ns") is not None:
            offsets.append(
                (
                    int(row["number"]),
                    int(row["t_start_ns"]),
                    int(row["t_end_ns"]),
                    int(row["clock_offset_ns"]),
                )
            )
    return offsets


def _runs(frame_index: Any) -> tuple[dict[int, int], dict[int, int]]:
    """Return the first and last row of every frame."""
    first: dict[int, int] = {}
    last: dict[int, int] = {}
    for row, frame in enumerate(frame_index.tolist()):
        first.setdefault(frame, row)
        last[frame] = row
    return first, last


def _pose(head: Columns, i: int) -> Pose:
    return Pose(
        head["position_m"][i].astype(np.float64), head["orientation_wxyz"][i].astype(np.float64)
    )


def _batch(recording: Recording, gaze: Columns, rows: list[int]) -> SampleBatch:
    schema = recording.stream_schema(GAZE.name) or GAZE
    values = empty_values(schema, len(rows))
    for field in schema.fields:
        values[field.name] = gaze[field.name][rows]
    return SampleBatch(
        schema, gaze["seq"][rows], gaze["t_device_ns"][rows], gaze["t_host_ns"][rows], values
    )


def _columns(schema: StreamSchema, batches: list[SampleBatch], part: int) -> Columns:
    """Return batches as a recording returns a stream."""
    n = sum(len(batch.seq) for batch in batches)

    def join(of: Any) -> Any:
        return (
            np.concatenate([of(batch) for batch in batches]) if batches else np.zeros(0, np.int64)
        )

    columns: Columns = {
        "seq": join(lambda b: b.seq),
        "t_device_ns": join(lambda b: b.t_device_ns),
        "t_host_ns": join(lambda b: b.t_host_ns),
    }
    for field in schema.fields:
        name = field.name
        columns[name] = (
            np.concatenate([batch.values[name] for batch in batches])
            if batches
            else empty_values(schema, 0)[name]
        )
    return {**columns, PART_COLUMN: np.full(n, part, np.int16)}

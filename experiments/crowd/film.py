"""A film of one recorded walk: from above, the body, contacts lit, the vibrations of every band."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from experiments.crowd.film_drawing import FilmFrame, FilmPainter
from experiments.crowd.haptics import BAND_ROLES
from experiments.crowd.pulses import contact_spans
from experiments.crowd.replay import Walk, walk_of
from lab.errors import UsageError
from recording.reader import Recording
from stage.movie import open_movie
from stimuli.contact.body import CAPSULE_JOINTS, capsule_body
from stimuli.contact.idle import crowd_poses
from stimuli.contact.touch import TouchSensor

DEFAULT_SIZE_PX: Final = (1280, 720)
DEFAULT_RATE_HZ: Final = 25


@dataclass(frozen=True)
class Span:
    """A contact on a band's segment: seconds from the walk's start, and whether it vibrated."""

    role: str
    begin_s: float
    end_s: float
    vibrated: bool


def write_film(
    recording: Recording,
    trial_id: str,
    video: Path,
    *,
    size_px: tuple[int, int] = DEFAULT_SIZE_PX,
    rate_hz: int = DEFAULT_RATE_HZ,
    seconds: float | None = None,
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Write the film of one walk and return its number of frames; `seconds` shortens it.

    Raises:
        UsageError: there is no such walk, or no size or rate of a film.
        StageError: the film cannot be written.
    """
    walk = walk_of(recording, trial_id)
    return film_walk(
        walk,
        spans_of(recording, walk),
        video,
        title=title_of(recording, walk),
        is_simulated=recording.is_simulated,
        size_px=size_px,
        rate_hz=rate_hz,
        seconds=seconds,
        on_frame=on_frame,
    )


def film_walk(
    walk: Walk,
    spans: list[Span],
    video: Path,
    *,
    title: str,
    is_simulated: bool,
    size_px: tuple[int, int] = DEFAULT_SIZE_PX,
    rate_hz: int = DEFAULT_RATE_HZ,
    seconds: float | None = None,
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Write the film of a walk with its contacts; see `write_film`."""
    if rate_hz < 1 or min(size_px) < 240:
        raise UsageError(
            f"a film of {size_px[0]} × {size_px[1]} pixels at {rate_hz} frames a second cannot be "
            "drawn; give at least 240 pixels each way and one frame a second"
        )
    if not len(walk.t_ns):
        raise UsageError(f"walk {walk.trial_id} has no step that could be drawn")
    painter = FilmPainter(
        size_px,
        walk,
        [(s.role, s.begin_s, s.end_s, s.vibrated) for s in spans],
        title=title,
        is_simulated=is_simulated,
    )
    steps = walk.steps_at(rate_hz, np.inf if seconds is None else seconds)
    with open_movie(video, painter.size_px, rate_hz) as film:
        for k, frame in enumerate(frames(walk, steps, spans)):
            film.add(painter.paint(frame))
            if on_frame is not None:
                on_frame(k + 1, len(steps))
    return len(steps)


def frames(walk: Walk, steps: npt.NDArray[np.int64], spans: list[Span]) -> Iterator[FilmFrame]:
    """Yield what is to be drawn, step by step; a lost body is drawn as lost."""
    sensor = TouchSensor(walk.crowd)
    body = capsule_body(walk.stature_m)
    since_s = walk.crowd_t_s
    for i in steps.tolist():
        t_s = float(since_s[i])
        people_m, _ = crowd_poses(walk.people, t_s)
        position, turn = walk.position_m[i], walk.orientation_wxyz[i]
        parts: frozenset[str] = frozenset()
        touched: frozenset[int] = frozenset()
        is_tracked = bool(np.isfinite(position).all() and np.isfinite(turn).all())
        if is_tracked:
            starts, ends = body.posed(position, turn)
            found = sensor.touches(starts, ends, body.radius_m, t_s)
            parts = frozenset(CAPSULE_JOINTS[t.part] for t in found)
            touched = frozenset(t.person for t in found)
        yield FilmFrame(
            step=i,
            t_s=t_s,
            position_m=position,
            is_tracked=is_tracked,
            people_m=people_m,
            parts=parts,
            touched=touched,
            vibrating=frozenset(s.role for s in spans if s.vibrated and s.begin_s <= t_s < s.end_s),
        )


def spans_of(recording: Recording, walk: Walk) -> list[Span]:
    """Return every contact that a band's segment had in a walk, as the session decided it."""
    start_ns, end_ns = int(walk.row["t_start_ns"]), int(walk.row["t_end_ns"])
    return [
        Span(
            row["role"],
            (row["begin_ns"] - start_ns) / 1e9,
            ((end_ns if row["end_ns"] is None else row["end_ns"]) - start_ns) / 1e9,
            bool(row["vibrates"]),
        )
        for row in contact_spans(recording)
        if row["trial_id"] == walk.trial_id and row["role"] in BAND_ROLES
    ]


def title_of(recording: Recording, walk: Walk) -> str:
    """Return the line over the film."""
    row = walk.row
    return (
        f"crowd  {recording.manifest.participant}  {walk.trial_id}  {row['condition']}  "
        f"configuration {row['configuration']}"
    )

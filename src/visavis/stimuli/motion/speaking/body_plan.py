"""Plan a speaker's body for a gesture script: a posture for each phrase, pieces of a corpus that
lead there at the right time, and what fills the time between them.

Source: a study of gestures with full-body posture; what it leaves open is marked as our choice.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DataError
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.body_track import RATE_HZ, YAW
from visavis.stimuli.motion.speaking.gesture_script import HANDS, GestureScript
from visavis.stimuli.motion.speaking.speaker import NINE, Clip, Posture, Speaker
from visavis.stimuli.motion.synthesis.gap_filling import (
    Hold,
    fill_gap,
    ranked_segments,
)

Fill = Literal["F", "I", "none"]
YAW_BEFORE_01: Final = 0.10
COM_AFTER_01: Final = 0.20
"""Hips come to their extreme up to so much of a mean phrase before the stroke's end, weight after
it: drawn evenly (our choice).
"""
WINDOW: Final = 15
"""Frames compared on either side of a gap; the source uses 10 to 30."""
MIN_GAP_S: Final = 0.25
CANDIDATES: Final = 12
"""So many pieces of a posture are drawn, of which the one that begins most like idling is taken:
the best of all would always be the same (our choice).
"""
SEGMENTS: Final = 64
"""So many pieces that fit a gap are tried where velocity jumps at the edges of the best."""
ENTER_STEP: Final = 1
CALM: Final = 1.0
GROWTH: Final = 1.5
"""A filled gap moves at most so many times as far as its source (our choice)."""
ALIKE_TEMPO: Final = (0.7, 1.4)
"""One longer piece serves two phrases where its time need not be stretched beyond this."""
PEAK: Final[dict[Fill, float]] = {"F": 2.0, "I": 3.0, "none": 1.0}
"""How much faster than on average a filled gap moves at most; an interpolation takes half of it."""
TRUNK_RAD: Final = float(np.radians(15.0))
LATEST_ONSET_S: Final = 0.1
"""The spine turns for at least so long before its stroke ends."""


class Piece(NamedTuple):
    """Frames of the plan from `first` on that come from a clip, shape (n, 6)."""

    first: int
    hips: Vector


class Turn(NamedTuple):
    """The spine turns from `start_s` to `end_s` until it is `trunk_rad` to the left."""

    start_s: float
    end_s: float
    trunk_rad: float


@dataclass(frozen=True, eq=False)
class BodyPlan:
    """The lower body of a whole script: `hips` (n, 6) as in `BodyTrack`, at `RATE_HZ`.

    `postures` are those that phrases end in; `junctions` the frames where a piece ends or begins;
    `turns` of the spine. `is_longer` marks phrases that go on in the piece of the one before.
    """

    hips: Vector
    postures: tuple[Posture, ...]
    junctions: tuple[int, ...]
    turns: tuple[Turn, ...]
    is_longer: tuple[bool, ...]


def sample_postures(
    speaker: Speaker, script: GestureScript, rng: np.random.Generator
) -> tuple[Posture, ...]:
    """Draw the posture at the end of every phrase; the speaker begins in the middle.

    Postures that the speaker was never recorded in, with both feet planted, are not drawn.

    Raises:
        DataError: nothing is known of what follows a posture.
    """
    counts = speaker.counts()
    is_there = np.array([posture in counts for posture in NINE], dtype=np.float64)
    com, yaw = "centre", "front"
    postures_drawn = []
    for phrase in script.phrases:
        shares = speaker.habits.joint(com, yaw, HANDS[phrase.hand], phrase.lexeme) * is_there
        if not shares.sum() > 0:
            raise DataError(
                f"no posture that may follow weight {com}, hips {yaw} was recorded on planted "
                "feet; annotate more speech"
            )
        com, yaw = NINE[int(rng.choice(len(NINE), p=shares / shares.sum()))]
        postures_drawn.append((com, yaw))
    return tuple(postures_drawn)


def plan_body(speaker: Speaker, script: GestureScript, fill: Fill, seed: int) -> BodyPlan:
    """Return the body of a script. `fill` F takes idle motion from the corpus, I interpolates and
    holds, none leaves the body still.

    Raises:
        DataError: the corpus is too small for the script, or `fill` is none of these.
    """
    n = int(np.ceil(script.duration_s * RATE_HZ)) + 1
    if fill not in ("F", "I", "none"):
        raise MotionError(f"no way {fill!r} to fill gaps; give F, I or none")
    if fill == "none" or not script.phrases:
        hips = np.repeat(speaker.neutral[None], n, axis=0)
        return BodyPlan(hips, (), (), (), ())
    rng = np.random.default_rng((seed, 40))
    postures = sample_postures(speaker, script, rng)
    pieces, is_longer = _pieces(speaker, script, postures, rng, n)
    pieces = _without_haste(speaker, pieces, fill)
    hips = np.empty((n, 6))
    junctions: list[int] = []
    begin = 0
    for piece in pieces:
        to = _join(speaker, hips, begin, piece, fill)
        junctions += [begin, to] if begin else [to]
        begin = piece.first + len(piece.hips)
    # After the last piece the speaker goes back to the middle.
    if begin < n:
        _join(speaker, hips, begin, Piece(n, np.empty((0, 6))), fill)
        junctions.append(begin)
    return BodyPlan(
        hips, postures, tuple(junctions), _turns(speaker, script, postures, rng), is_longer
    )


def _pieces(
    speaker: Speaker,
    script: GestureScript,
    postures: Sequence[Posture],
    rng: np.random.Generator,
    n: int,
) -> tuple[list[Piece], tuple[bool, ...]]:
    """Choose and place a piece for every phrase; one longer one where a posture is repeated."""
    clips: set[int] = set()
    pieces: list[Piece] = []
    is_longer = [False] * len(postures)
    free = 0
    i = 0
    while i < len(postures):
        phrase = script.phrases[i]
        yaw_at = phrase.stroke_end_s - YAW_BEFORE_01 * speaker.mean_phrase_s * rng.random()
        com_at = phrase.stroke_end_s + COM_AFTER_01 * speaker.mean_phrase_s * rng.random()
        clip, tempo, count = _choose(speaker, script, postures, i, clips, rng)
        end_phrase = script.phrases[i + count - 1]
        clips.add(clip.row)
        is_longer[i + 1 : i + count] = [True] * (count - 1)
        # As much of the clip as it has, and as the phrases have, on both sides of the stroke's end.
        before_s = min(
            phrase.stroke_end_s - phrase.start_s, (clip.stroke_end - clip.first) / RATE_HZ
        )
        after_s = min(
            end_phrase.end_s - phrase.stroke_end_s,
            (clip.last - clip.stroke_end) / RATE_HZ / tempo,
        )
        first = max(free, int(np.ceil((phrase.stroke_end_s - before_s) * RATE_HZ)))
        last = min(n - 1, int(np.floor((phrase.stroke_end_s + after_s) * RATE_HZ)))
        t_s = np.arange(first, last + 1) / RATE_HZ
        if len(t_s) >= 2:
            take = speaker.takes[clip.take].track.hips
            columns = np.empty((len(t_s), 6))
            for column in range(6):
                end, at = (clip.yaw_end, yaw_at) if column == YAW else (clip.com_end, com_at)
                since = (t_s - at) * RATE_HZ
                # A longer piece keeps the speaker's tempo up to its first stroke's end.
                rows = end + np.where(since > 0, since * tempo, since)
                columns[:, column] = np.interp(rows, np.arange(len(take)), take[:, column])
            pieces.append(Piece(first, columns))
            free = last + 1 + round(MIN_GAP_S * RATE_HZ)
        i += count
    return pieces, tuple(is_longer)


def _choose(
    speaker: Speaker,
    script: GestureScript,
    postures: Sequence[Posture],
    i: int,
    used: set[int],
    rng: np.random.Generator,
) -> tuple[Clip, float, int]:
    """Return a clip for phrase `i`, how much faster its time passes, and how many phrases it is
    for.
    """
    posture = postures[i]
    if i + 1 < len(postures) and postures[i + 1] == posture:
        apart = (script.phrases[i + 1].stroke_end_s - script.phrases[i].stroke_end_s) * RATE_HZ
        longer = []
        for one, other in zip(speaker.clips, speaker.clips[1:], strict=False):
            follows = other.row == one.row + 1 and other.take == one.take
            if not follows or not one.posture == other.posture == posture or one.row in used:
                continue
            steps = speaker.takes[one.take].track.steps[one.first : other.last + 1]
            tempo = (other.stroke_end - one.stroke_end) / apart
            if ALIKE_TEMPO[0] <= tempo <= ALIKE_TEMPO[1] and not steps.any():
                longer.append((one, other, tempo))
        if longer:
            candidates = [longer[k] for k in rng.permutation(len(longer))[:CANDIDATES]]
            one, other, tempo = min(
                candidates, key=lambda pair: abs(pair[0].start_speed - speaker.idle_speed)
            )
            return replace(one, last=other.last), tempo, 2
    group = [clip for clip in speaker.clips if clip.posture == posture]
    fresh = [clip for clip in group if clip.row not in used] or group
    drawn_clips = [fresh[k] for k in rng.permutation(len(fresh))[:CANDIDATES]]
    best = min(drawn_clips, key=lambda clip: abs(clip.start_speed - speaker.idle_speed))
    return best, 1.0, 1


def _without_haste(speaker: Speaker, pieces: Sequence[Piece], fill: Fill) -> list[Piece]:
    """Enter a piece later where the way to its beginning would be too fast: as early as the speed
    stays below that of the speaker in 95 of 100 frames, or else where it is least.
    """
    result: list[Piece] = []
    for piece in pieces:
        if result:
            last = result[-1].hips[-1, [0, YAW]]
            end = result[-1].first + len(result[-1].hips) - 1
            values = piece.hips[:, [0, YAW]]
            gap_s = (piece.first + np.arange(len(values)) - end) / RATE_HZ
            speed = PEAK[fill] * np.abs(values - last) / gap_s[:, None]
            if fill == "I":
                # An interpolation arrives at rest: what the piece moves at then is a jump.
                speed = np.maximum(speed, np.abs(np.gradient(values, axis=0)) * RATE_HZ)
            haste = (speed / speaker.scale / speaker.fast).max(axis=1)
            # Not beyond its last frames: they are the posture that was drawn.
            haste = haste[: max(1, len(haste) - 2)]
            enter = int(np.argmax(haste <= 1.0)) if (haste <= 1.0).any() else int(np.argmin(haste))
            piece = Piece(piece.first + enter, piece.hips[enter:])
        result.append(piece)
    return result


def _join(speaker: Speaker, hips: Vector, begin: int, piece: Piece, fill: Fill) -> int:
    """Write a piece and what leads to it from frame `begin` on; return where the piece begins.

    Where velocity would jump by more than the speaker's fast frames have, the piece is entered
    later; if that does not help, the gap is filled with what fits next best, or else so that it
    jumps least.
    """
    best = (np.inf, piece.first, np.empty((0, 6)))
    for to, filled in _ways(speaker, hips, begin, piece, fill):
        own = piece.hips[to - piece.first :]
        hips[begin:to] = filled
        hips[to : to + len(own)] = own
        jump = max(_jump(speaker, hips[: to + len(own)], k) for k in (begin, to))
        if jump < best[0]:
            best = (jump, to, filled)
        if jump <= CALM:
            break
    _, to, filled = best
    hips[begin:to] = filled
    own = piece.hips[to - piece.first :]
    hips[to : to + len(own)] = own
    return to


def _ways(
    speaker: Speaker, hips: Vector, begin: int, piece: Piece, fill: Fill
) -> Iterator[tuple[int, Vector]]:
    """Yield where a piece may be entered, with what fills the frames before: the best filling of
    every entry, then the others.
    """
    for first, last in ((0, 1), (1, None)):
        for enter in range(0, max(1, len(piece.hips) - 2), ENTER_STEP):
            to = piece.first + enter
            fillings = _fillings(speaker, hips, begin, piece.hips[enter:], to, fill)
            for filled in islice(fillings, first, last):
                yield to, filled


def _jump(speaker: Speaker, hips: Vector, k: int) -> float:
    """Return by how much velocity changes at most about frame `k`, in speeds of fast frames."""
    speed = np.diff(hips[max(0, k - 2) : k + 2][:, [0, YAW]], axis=0) * RATE_HZ
    if len(speed) < 2:
        return 0.0
    return float((np.abs(np.diff(speed, axis=0)) / speaker.scale / speaker.fast).max())


def _fillings(
    speaker: Speaker, hips: Vector, begin: int, then: Vector, to: int, fill: Fill
) -> Iterator[Vector]:
    """Yield frames `begin` to `to` of the plan, between `hips` before and `then` after them, what
    fits best first; where there is nothing, the speaker stands in the middle.
    """
    gap = to - begin
    if not gap:
        yield np.empty((0, 6))
        return
    neutral = speaker.neutral[None]
    last = hips[begin - 1 : begin] if begin > 0 else neutral
    following = then[:1] if len(then) else neutral
    if fill == "I":
        speed = (hips[begin - 1] - hips[begin - 2]) * RATE_HZ if begin > 1 else np.zeros(6)
        t_s = np.arange(1, gap + 1) / RATE_HZ
        whole_s = (gap + 1) / RATE_HZ
        yield np.stack(
            [
                Hold(float(last[0, c]), float(speed[c]), float(following[0, c]), whole_s).at(t_s)
                for c in range(6)
            ],
            axis=1,
        )
        return
    before = _surroundings(hips[:begin][-WINDOW - 1 :], last, is_before=True)
    after = _surroundings(then[: WINDOW + 1], following, is_before=False)
    share = (np.arange(1, gap + 1) / (gap + 1))[:, None]
    straight = (1 - share) * last + share * following
    for take, start in _search(speaker, before[:, [0, YAW]], after[:, [0, YAW]], gap):
        track = speaker.takes[take].track
        piece = fill_gap(track.hips, before, after, gap, start)
        # Where the bent piece moves much farther than its source, only its deviation is made
        # smaller: its ends stay.
        source = track.hips[start : start + gap + 2]
        limit = GROWTH * np.maximum(np.ptp(source, axis=0), np.abs(following - last)[0])
        moves = np.maximum(np.ptp(piece, axis=0), 1e-12)
        yield straight + np.minimum(1.0, limit / moves) * (piece - straight)


def _surroundings(rows: Vector, edge: Vector, *, is_before: bool) -> Vector:
    """Return `WINDOW` + 1 frames on one side of a gap; what is missing stands still."""
    missing = WINDOW + 1 - len(rows)
    if missing <= 0:
        return rows
    if not len(rows):
        return np.repeat(edge, WINDOW + 1, axis=0)
    still = np.repeat(rows[:1] if is_before else rows[-1:], missing, axis=0)
    return np.concatenate([still, rows] if is_before else [rows, still])


def _search(speaker: Speaker, before: Vector, after: Vector, gap: int) -> list[tuple[int, int]]:
    """Return takes and frames of the pieces without a step that fit a gap, the best first.

    Raises:
        MotionError: the corpus has no such piece.
    """
    pieces: list[tuple[float, int, int]] = []
    for k, take in enumerate(speaker.takes):
        # The hips' place and yaw stand for weight and direction, as they are what is filled.
        source = take.track.hips[:, [0, YAW]] / speaker.scale
        for first, last in _runs(take.track.steps):
            if last - first < gap + 2 * WINDOW + 3:
                continue
            ranked = ranked_segments(
                source[first:last], before / speaker.scale, after / speaker.scale, gap, WINDOW
            )
            pieces += [(segment.distance, k, first + segment.start) for segment in ranked]
    if not pieces:
        raise MotionError(
            f"no {gap / RATE_HZ:.1f} s of the corpus on planted feet can fill a gap; record longer "
            "takes, or fill by interpolation (I)"
        )
    return [(take, start) for _, take, start in sorted(pieces)[:SEGMENTS]]


def _runs(steps: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return first and one past the last frame of every run without a step."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], steps, [True]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _turns(
    speaker: Speaker,
    script: GestureScript,
    postures: Sequence[Posture],
    rng: np.random.Generator,
) -> tuple[Turn, ...]:
    """Return how the spine turns towards the direction of each phrase."""
    turns = []
    free_s = 0.0
    sides = {"left": TRUNK_RAD, "front": 0.0, "right": -TRUNK_RAD}
    delay = speaker.trunk_delay
    for phrase, (_, yaw) in zip(script.phrases, postures, strict=True):
        start_s = phrase.start_s + float(rng.normal(delay.mean_s, delay.sd_s))
        end_s = phrase.stroke_end_s
        start_s = max(free_s, min(start_s, end_s - LATEST_ONSET_S))
        turns.append(Turn(start_s, max(end_s, start_s + LATEST_ONSET_S), sides[yaw]))
        free_s = turns[-1].end_s
    return tuple(turns)


def trunk_of(turns: Sequence[Turn], t_s: Vector) -> Vector:
    """Return how far the spine is turned to the left at times (n,), radians."""
    trunk = np.zeros(len(t_s))
    at = 0.0
    for turn in turns:
        share = np.clip((t_s - turn.start_s) / (turn.end_s - turn.start_s), 0.0, 1.0)
        trunk += (turn.trunk_rad - at) * share**3 * (10.0 + share * (6.0 * share - 15.0))
        at = turn.trunk_rad
    return trunk

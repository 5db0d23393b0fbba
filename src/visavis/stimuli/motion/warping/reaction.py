"""Is that wave meant for me? Decided from what an observer sees of somebody else.

Three cues, as people name them: how the trunk is turned, how far the hand swings across the line
of sight, and where the eyes look. Cues that cannot be seen are left out, and without a hand that
is seen to swing there is no wave at all. Weights and widths are ours: gaze counts most (all
participants of the published study named the eyes, three of four the body); gaze within some
degrees is felt as being looked at (Gamer & Hecht 2007, J Exp Psychol HPP 33:705).
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector, angle_deg, rotate, unit
from visavis.stimuli.characters.body_parts import PART_INDEX
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import Skeleton, forward
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import SeenBody, perceived_parts

FRONT: Final = np.array([0.0, 0.0, -1.0])
SIDES: Final = ("left", "right")
NOISE_FOREARMS: Final = 0.12
"""A turn back counts only after so much of a forearm; smaller ones are sway."""


@dataclass(frozen=True, eq=False)
class SeenMotion:
    """A person's motion as an observer has seen it, at n moments.

    `t_s` (n,) ascending; `root_m` (n, 3), `local_wxyz` (n, 55, 4) where they stood;
    `eye_m` (n, 3) where the observer's eyes were; `face`, `trunk` (n,) and `hands` (n, 2), left
    first, say what of them could be seen.
    """

    t_s: Vector
    root_m: Vector
    local_wxyz: Vector
    eye_m: Vector
    face: Vector
    trunk: Vector
    hands: Vector


@dataclass(frozen=True)
class WaveCues:
    """Cues of one stretch of time; NaN where nothing was seen of what they need.

    `hand` is the side that swings most across the line of sight, `amplitude_forearms` from end to
    end in lengths of the forearm, `amplitude_deg` as the observer sees it, `turns` how often it
    turned back, `raised_share_01` for how much of the time it was above its elbow. `body_deg` and
    `gaze_deg` lie between the front of the trunk (level) and the line of the eyes on one side and
    the way to the observer on the other, medians over the time seen.
    """

    hand: str
    amplitude_forearms: float
    amplitude_deg: float
    turns: int
    raised_share_01: float
    body_deg: float
    gaze_deg: float


@dataclass(frozen=True)
class WaveRule:
    """When a wave counts as meant: limits of a wave, widths and weights of the cues."""

    least_forearms: float = 0.3
    least_deg: float = 0.3
    least_turns: int = 2
    least_raised_01: float = 0.6
    gaze_width_deg: float = 10.0
    body_width_deg: float = 35.0
    full_forearms: float = 0.8
    gaze_weight: float = 0.55
    body_weight: float = 0.3
    amplitude_weight: float = 0.15
    least_score_01: float = 0.5

    def __post_init__(self) -> None:
        if not all(np.isfinite(v) and v > 0 for v in vars(self).values()):
            raise MotionError(f"every number of a wave rule is above 0; got {self}")


@dataclass(frozen=True)
class Judgement:
    """Whether somebody waves, and whether at the observer; `score_01` is NaN without a wave."""

    waves: bool
    is_meant: bool
    score_01: float
    cues: WaveCues


def wave_cues(skeleton: Skeleton, motion: SeenMotion) -> WaveCues:
    """Measure the cues of a stretch of time.

    Raises:
        MotionError: there are fewer than two moments.
    """
    if len(motion.t_s) < 2:
        raise MotionError(f"{len(motion.t_s)} moments hold no movement; look at two or more")
    place = forward(skeleton, motion.root_m, motion.local_wxyz)
    at = {name: place.position_m[:, i] for name, i in skeleton.index_of.items()}
    turns_of = {name: place.orientation_wxyz[:, i] for name, i in skeleton.index_of.items()}
    trunk = rotate(turns_of["upper_chest"], FRONT)
    to_observer = motion.eye_m - at["upper_chest"]
    body = _level_angle_deg(trunk, to_observer)
    eyes = (at["left_eye"] + at["right_eye"]) / 2
    looks = unit(rotate(turns_of["left_eye"], FRONT) + rotate(turns_of["right_eye"], FRONT))
    gaze = angle_deg(looks, unit(motion.eye_m - eyes))
    swings = [_swing(skeleton, at, side, motion, k) for k, side in enumerate(SIDES)]
    hand, amplitude, degrees, turns, raised_share_01 = max(swings, key=lambda s: (s[3] >= 2, s[1]))
    return WaveCues(
        hand=hand,
        amplitude_forearms=amplitude,
        amplitude_deg=degrees,
        turns=turns,
        raised_share_01=raised_share_01,
        body_deg=_median(body, motion.trunk),
        gaze_deg=_median(gaze, motion.face),
    )


def judge(cues: WaveCues, rule: WaveRule | None = None) -> Judgement:
    """Decide from cues whether somebody waves, and whether it is meant for the observer."""
    r = rule or WaveRule()
    waves = (
        cues.turns >= r.least_turns
        and cues.amplitude_forearms >= r.least_forearms
        and cues.amplitude_deg >= r.least_deg
        and cues.raised_share_01 >= r.least_raised_01
    )
    if not waves:
        return Judgement(False, False, float("nan"), cues)
    evidence = [(r.amplitude_weight, min(1.0, cues.amplitude_forearms / r.full_forearms))]
    if np.isfinite(cues.gaze_deg):
        evidence.append((r.gaze_weight, float(np.exp(-((cues.gaze_deg / r.gaze_width_deg) ** 2)))))
    if np.isfinite(cues.body_deg):
        evidence.append((r.body_weight, float(np.exp(-((cues.body_deg / r.body_width_deg) ** 2)))))
    weight = sum(w for w, _ in evidence)
    score = sum(w * value for w, value in evidence) / weight
    # How far a hand swings does not tell whom it is for: something must point to the observer.
    return Judgement(True, len(evidence) > 1 and score >= r.least_score_01, score, cues)


def looked_at(
    body: SeenBody, view: Outlook, root_m: Vector, local_wxyz: Vector, *, least_px: int = 3
) -> tuple[bool, bool, tuple[bool, bool]]:
    """Tell whether face, trunk and hands (left, right) of a pose can be seen in a view."""
    ids = perceived_parts(body, view, root_m[None], local_wxyz[None])[0]
    count = np.bincount(ids.ravel(), minlength=256)

    def some(*parts: str) -> bool:
        return int(sum(count[PART_INDEX[p]] for p in parts)) >= least_px

    return (
        some("face", "left_eye", "right_eye"),
        some("torso"),
        (some("left_hand"), some("right_hand")),
    )


class WaveWatcher:
    """Watch one other agent frame by frame and say when they wave at oneself.

    Keeps the last `window_s`; after a wave that was meant, the next is told `rest_s` later.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        *,
        rule: WaveRule | None = None,
        window_s: float = 1.5,
        rest_s: float = 3.0,
    ) -> None:
        self._skeleton, self._rule = skeleton, rule or WaveRule()
        self._window_ns, self._rest_ns = round(window_s * NS_PER_S), round(rest_s * NS_PER_S)
        self._rows: deque[tuple[int, Vector, Vector, Vector, bool, bool, tuple[bool, bool]]] = (
            deque()
        )
        self._told_ns: int | None = None

    def observe(
        self,
        t_ns: int,
        root_m: Vector,
        local_wxyz: Vector,
        eye_m: Vector,
        *,
        face: bool = True,
        trunk: bool = True,
        hands: tuple[bool, bool] = (True, True),
    ) -> Judgement | None:
        """Take in a frame; `looked_at` says what of them can be seen.

        Returns a judgement over the window, None until it is half full.
        """
        self._rows.append((t_ns, root_m, local_wxyz, eye_m, face, trunk, hands))
        while self._rows[0][0] < t_ns - self._window_ns:
            self._rows.popleft()
        if 2 * (t_ns - self._rows[0][0]) < self._window_ns:
            return None
        t, root, turns, eye, faces, trunks, both = zip(*self._rows, strict=True)
        seen = SeenMotion(
            (np.array(t) - t[0]) / NS_PER_S,
            np.array(root),
            np.array(turns),
            np.array(eye),
            np.array(faces),
            np.array(trunks),
            np.array(both),
        )
        return judge(wave_cues(self._skeleton, seen), self._rule)

    def reacts(self, t_ns: int, judgement: Judgement | None) -> bool:
        """Tell once that a wave is meant for oneself, then keep quiet for a while."""
        if judgement is None or not judgement.is_meant:
            return False
        if self._told_ns is not None and t_ns < self._told_ns + self._rest_ns:
            return False
        self._told_ns = t_ns
        return True


def _level_angle_deg(direction: Vector, way: Vector) -> Vector:
    """Return the angles (n,) between two directions (n, 3) seen from above."""
    flat = np.array([1.0, 0.0, 1.0])
    return angle_deg(unit(direction * flat), unit(way * flat))


def _median(values: Vector, is_seen: Vector) -> float:
    """Return the median over the moments seen, NaN when that is less than a third of them."""
    valid = values[np.asarray(is_seen, dtype=np.bool_) & np.isfinite(values)]
    return float(np.median(valid)) if 3 * len(valid) >= len(values) else float("nan")


def _swing(
    skeleton: Skeleton, at: dict[str, Vector], side: str, motion: SeenMotion, k: int
) -> tuple[str, float, float, int, float]:
    """Return a hand's swing across the line of sight while it was seen."""
    is_visible = np.asarray(motion.hands[:, k], dtype=np.bool_)
    if 2 * is_visible.sum() < len(is_visible) or is_visible.sum() < 3:
        return side, 0.0, 0.0, 0, 0.0
    hand, elbow = at[f"{side}_hand"], at[f"{side}_lower_arm"]
    forearm = float(np.linalg.norm(skeleton.offsets_m[skeleton.index(f"{side}_hand")]))
    # The middle of the hand tells more than the wrist, which a wave from the wrist leaves still.
    knuckle = at.get(f"{side}_middle_proximal", hand)
    way = motion.eye_m - hand
    across = np.cross(way, np.array([0.0, 1.0, 0.0]))
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    offset = np.sum((knuckle - at["upper_chest"]) * across, axis=1)[is_visible]
    span = float(offset.max() - offset.min())
    distance = float(np.median(np.linalg.norm(way, axis=1)))
    degrees = float(np.degrees(2 * np.arctan2(span / 2, distance)))
    raised_share_01 = float((hand[is_visible, 1] > elbow[is_visible, 1]).mean())
    return side, span / forearm, degrees, _turns(offset, NOISE_FOREARMS * forearm), raised_share_01


def _turns(series: Vector, least: float) -> int:
    """Count how often a series turns back by at least so much."""
    count, way = 0, 0
    low = high = float(series[0])
    for value in map(float, series[1:]):
        low, high = min(low, value), max(high, value)
        if way != 1 and value - low >= least:
            count, way, high = count + (way != 0), 1, value
        elif way != -1 and high - value >= least:
            count, way, low = count + (way != 0), -1, value
    return count

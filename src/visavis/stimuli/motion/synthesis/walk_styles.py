"""Walks in styles: ten at one speed, and nine emotions at three speeds, from a few numbers each.

Styles are ours. The emotions are those of Russell's circle of pleasure and arousal (1980) that a
study of walks used: an actor walked there, here a gait is changed as the literature describes
walks of these moods (posture, head, arm swing, bounce, foot lift).
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Final

import numpy as np

from visavis.lab.geometry import Vector, quat_conjugate, quat_multiply
from visavis.stimuli.motion import posture as p
from visavis.stimuli.motion.build import Build, build_of_skeleton
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.posture_kernels import pose_rows
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton, forward
from visavis.stimuli.motion.synthesis.examples import Examples, examples_of_clips
from visavis.stimuli.motion.synthesis.styled_gait_kernels import styled_rows

FRAME_S: Final = 1.0 / 30.0
SEED: Final = 3
"""Whose fingers curl."""
WALK_JOINTS: Final = (
    "hips", "spine", "neck", "head",
    *(
        f"{side}_{part}"
        for side in ("left", "right")
        for part in (
            "shoulder", "upper_arm", "lower_arm", "hand",
            "upper_leg", "lower_leg", "foot", "toes",
        )
    ),
)  # fmt: skip
"""The twenty joints of example walks; their spine carries the turn of our upper chest."""


@dataclass(frozen=True)
class WalkStyle:
    """A style of walking. Lengths are shares of the leg (thigh and shin), angles degrees; factors
    are 1 in a plain walk. A cycle takes `frames`, an even number, at 30 a second; toes leave the
    floor at the frame nearest to `stance_01`.
    """

    frames: int = 34
    step_01: float = 0.83
    stance_01: float = 0.60
    """Share of the cycle that a foot stands."""
    width: float = 0.62
    """How far the feet are apart, of the distance of the hips."""
    toes_out_deg: float = 6.0
    lift: float = 1.0
    """How high feet swing."""
    roll: float = 1.0
    """How far feet roll over heel and ball."""
    crouch_01: float = 0.0
    """How much lower the hips are on bent legs."""
    bounce: float = 1.0
    sway: float = 1.0
    """Swing of hips, trunk and head from side to side."""
    hips: float = 1.0
    """Turn and tilt of the pelvis."""
    lean_deg: float = 0.0
    """Trunk forward."""
    twist: float = 1.0
    """Turn of the trunk against the pelvis."""
    shoulders_deg: float = 0.0
    """Shoulders up."""
    slump_deg: float = 0.0
    """Round back, shoulders forward."""
    swing_deg: float = 20.0
    """Arms from the middle of their swing to an end."""
    arm_out_deg: float = 10.0
    elbow_deg: float = 20.0
    head_deg: float = 0.0
    """Head up."""
    sharp_01: float = 0.0
    """How suddenly arms and trunk change."""

    def __post_init__(self) -> None:
        for name, (least, most) in LIMITS.items():
            if not least <= (value := getattr(self, name)) <= most:
                raise MotionError(f"{name} of a walk is {value}; give {least} to {most}")
        if self.frames % 2:
            raise MotionError(f"a walk of {self.frames} frames; give an even number")
        whole = round(self.stance_01 * self.frames) / self.frames
        object.__setattr__(self, "stance_01", whole)

    @property
    def numbers(self) -> Vector:
        """What the kernel is given, angles in radians."""
        values = asdict(self)
        del values["frames"]
        return np.array(
            [np.radians(v) if name.endswith("_deg") else v for name, v in values.items()]
        )


LIMITS: Final[Mapping[str, tuple[float, float]]] = {
    "frames": (12, 120), "step_01": (0.1, 1.02), "stance_01": (0.54, 0.75), "width": (-0.5, 2.5),
    "toes_out_deg": (-20, 40), "lift": (0, 5), "roll": (0, 1.3), "crouch_01": (0, 0.25),
    "bounce": (-1, 3.5), "sway": (-1, 5), "hips": (-1, 4), "lean_deg": (-20, 45),
    "twist": (-1, 4), "shoulders_deg": (-10, 25), "slump_deg": (-15, 40), "swing_deg": (0, 60),
    "arm_out_deg": (0, 45), "elbow_deg": (3, 110), "head_deg": (-50, 30), "sharp_01": (0, 1),
}  # fmt: skip

PLAIN: Final = WalkStyle()
SPEEDS: Final = ("slow", "normal", "fast")
EMOTIONS: Final[Mapping[str, Mapping[str, float]]] = {
    "neutral": {},
    "excitement": {
        "bounce": 2.6, "swing_deg": 38, "elbow_deg": 48, "arm_out_deg": 19, "lift": 2.6,
        "head_deg": 9, "lean_deg": 1, "slump_deg": -9, "twist": 2.0, "sway": 1.5, "hips": 1.4,
        "step_01": 0.87,
    },
    "arousal": {
        "sharp_01": 0.8, "swing_deg": 32, "elbow_deg": 80, "shoulders_deg": 9, "head_deg": 3,
        "lean_deg": 9, "bounce": 1.2, "slump_deg": -6, "lift": 1.7, "sway": 0.4, "hips": 0.6,
        "step_01": 0.86, "arm_out_deg": 13,
    },
    "distress": {
        "sharp_01": 0.5, "swing_deg": 9, "elbow_deg": 82, "shoulders_deg": 14, "arm_out_deg": 14,
        "head_deg": -10, "lean_deg": 15, "slump_deg": 10, "width": 0.45, "step_01": 0.72,
        "crouch_01": 0.03, "bounce": 0.7, "twist": 0.4,
    },
    "misery": {
        "swing_deg": 6, "elbow_deg": 30, "shoulders_deg": 2, "head_deg": -30, "lean_deg": 19,
        "slump_deg": 26, "step_01": 0.70, "lift": 0.65, "roll": 0.75, "bounce": 0.5, "twist": 0.3,
        "hips": 0.5, "crouch_01": 0.05, "sway": 1.3,
    },
    "depression": {
        "swing_deg": 7, "elbow_deg": 12, "head_deg": -27, "lean_deg": 7, "slump_deg": 24,
        "step_01": 0.66, "lift": 0.55, "roll": 0.6, "bounce": 0.4, "twist": 0.4, "hips": 0.4,
        "shoulders_deg": -5, "arm_out_deg": 6, "sway": 0.8,
    },
    "sleepiness": {
        "swing_deg": 11, "elbow_deg": 8, "head_deg": -17, "lean_deg": -2, "slump_deg": 12,
        "step_01": 0.68, "lift": 0.4, "roll": 0.55, "bounce": 0.5, "sway": 4.2, "width": 1.15,
        "toes_out_deg": 14, "shoulders_deg": -6, "hips": 0.8, "stance_01": 0.64,
    },
    "contentment": {
        "swing_deg": 19, "elbow_deg": 13, "head_deg": 6, "lean_deg": -8, "slump_deg": -3,
        "step_01": 0.77, "bounce": 0.9, "sway": 2.8, "hips": 2.0, "toes_out_deg": 14,
        "width": 0.8, "stance_01": 0.62, "arm_out_deg": 11,
    },
    "pleasure": {
        "swing_deg": 31, "elbow_deg": 30, "head_deg": 10, "lean_deg": -3, "slump_deg": -9,
        "bounce": 2.2, "sway": 2.3, "hips": 2.2, "lift": 1.7, "twist": 1.7, "arm_out_deg": 17,
    },
}  # fmt: skip
"""What each of nine emotions changes of a plain walk at normal speed."""
STYLE_SPEED_MPS: Final = 1.2
"""Speed of all styles of set A, for legs of 0.86 m."""
STYLES: Final[Mapping[str, Mapping[str, float]]] = {
    "plain": {},
    "march": {
        "frames": 32, "swing_deg": 44, "elbow_deg": 10, "sharp_01": 0.6, "lift": 3.0, "sway": 0.2,
        "hips": 0.3, "twist": 0.2, "head_deg": 4, "slump_deg": -9, "width": 0.4, "roll": 0.8,
    },
    "strut": {
        "frames": 38, "swing_deg": 30, "elbow_deg": 34, "arm_out_deg": 27, "sway": 2.6,
        "width": 1.3, "lean_deg": -8, "slump_deg": -12, "head_deg": 8, "toes_out_deg": 20,
        "twist": 2.0, "shoulders_deg": 4,
    },
    "slouch": {
        "frames": 36, "slump_deg": 30, "head_deg": -20, "lean_deg": 6, "swing_deg": 10,
        "elbow_deg": 12, "lift": 0.7, "roll": 0.7, "shoulders_deg": -5, "hips": 0.6,
    },
    "tiptoe": {
        "frames": 28, "roll": 0.35, "lift": 2.6, "crouch_01": 0.02, "elbow_deg": 70,
        "swing_deg": 8, "arm_out_deg": 24, "shoulders_deg": 8, "width": 0.25, "bounce": 1.4,
        "head_deg": 2,
    },
    "creep": {
        "frames": 36, "crouch_01": 0.16, "lean_deg": 26, "head_deg": 4, "elbow_deg": 78,
        "swing_deg": 13, "arm_out_deg": 15, "lift": 3.2, "roll": 0.6, "width": 0.9, "bounce": 0.2,
    },
    "bounce": {
        "frames": 34, "bounce": 3.2, "swing_deg": 34, "elbow_deg": 40, "arm_out_deg": 17,
        "lift": 2.2, "head_deg": 7, "slump_deg": -7, "hips": 1.3,
    },
    "hips": {
        "frames": 34, "hips": 3.6, "sway": 3.0, "width": 0.05, "twist": 1.2, "swing_deg": 24,
        "elbow_deg": 16, "arm_out_deg": 17, "toes_out_deg": 3, "slump_deg": -6, "head_deg": 3,
    },
    "shuffle": {
        "frames": 24, "lift": 0.2, "roll": 0.25, "swing_deg": 5, "elbow_deg": 48, "lean_deg": 17,
        "slump_deg": 18, "head_deg": -8, "crouch_01": 0.07, "bounce": 0.3, "hips": 0.3,
        "twist": 0.2, "width": 1.0,
    },
    "totter": {
        "frames": 36, "sway": 5.0, "width": 1.9, "toes_out_deg": 22, "arm_out_deg": 31,
        "elbow_deg": 34, "swing_deg": 14, "lean_deg": -4, "head_deg": -4, "hips": 1.8,
        "crouch_01": 0.03, "stance_01": 0.64,
    },
}  # fmt: skip
"""Ten styles at one speed."""


def _styled(changes: Mapping[str, float]) -> WalkStyle:
    values = dict(changes)
    frames = round(values.pop("frames", PLAIN.frames))
    return replace(PLAIN, frames=frames, **values)


def style_a(name: str) -> WalkStyle:
    """Return a style of set A; steps are as long as the speed and the cycle ask for."""
    style = _styled(STYLES[name])
    return replace(style, step_01=STYLE_SPEED_MPS * style.frames * FRAME_S / 2.0 / 0.86)


def style_b(emotion: str, speed: str) -> WalkStyle:
    """Return an emotion at a speed: steps, pace and the size of movements change with speed."""
    style = _styled(EMOTIONS[emotion])
    if speed == "normal":
        return style
    quick = speed == "fast"
    return replace(
        style,
        frames=2 * round(style.frames * (0.40 if quick else 0.68)),
        step_01=min(1.0, style.step_01 * (1.17 if quick else 0.76)),
        stance_01=style.stance_01 - 0.025 if quick else style.stance_01 + 0.03,
        swing_deg=style.swing_deg * (1.25 if quick else 0.75),
        elbow_deg=style.elbow_deg * 1.2 + 6.0 if quick else style.elbow_deg * 0.9,
        lean_deg=style.lean_deg + (4.0 if quick else -1.0),
        bounce=style.bounce * (1.1 if quick else 0.85),
        lift=style.lift * (1.15 if quick else 0.85),
        sway=style.sway * (0.85 if quick else 1.15),
    )


def styled_walk(style: WalkStyle, build: Build) -> tuple[Clip, Vector]:
    """Return one cycle of a walk, a looping clip on 55 joints, and its key times (5,) in seconds.

    It starts as the left heel lands, at the origin, and leads to −z.
    """
    n = style.frames
    controls = np.empty((n, p.SIZE))
    styled_rows(np.arange(n) / n, style.numbers, build.lengths_m, SEED, controls)
    root, turns = np.empty((n, 3)), np.empty((n, p.JOINTS, 4))
    nobody = np.zeros(n, dtype=np.int64)
    unheld = np.zeros((n, 3))
    skeleton = build.skeleton
    pose_rows(
        controls,
        skeleton.offsets_m[None],
        nobody,
        nobody.astype(np.bool_),
        unheld,
        unheld,
        root,
        turns,
    )
    travel_m = 2.0 * style.step_01 * float(build.lengths_m[p.B_LEG])
    clip = Clip(skeleton, FRAME_S, root, turns, True, (0.0, 0.0, -travel_m))
    stance = style.stance_01
    return clip, np.array([0.0, stance - 0.5, 0.5, stance, 1.0]) * n * FRAME_S


@cache
def walk_skeleton(height_m: float = 1.75) -> Skeleton:
    """Return the skeleton of `WALK_JOINTS`, with the places of the canonical one."""
    return joints_only(canonical_skeleton(height_m))


def joints_only(skeleton: Skeleton) -> Skeleton:
    """Return the twenty joints of a canonical skeleton, each where it is."""
    rows = [skeleton.index(name) for name in WALK_JOINTS]
    parents = [-1, *(_parent_row(skeleton, name) for name in WALK_JOINTS[1:])]
    rest = skeleton.rest_m[rows]
    offsets = np.zeros_like(rest)
    offsets[1:] = rest[1:] - rest[parents[1:]]
    tips = skeleton.tips_m[rows].copy()
    for side in ("left", "right"):
        knuckle = skeleton.index(f"{side}_middle_proximal")
        hand = WALK_JOINTS.index(f"{side}_hand")
        tips[hand] = skeleton.rest_m[knuckle] - rest[hand]
    return Skeleton(WALK_JOINTS, np.array(parents, dtype=np.int64), offsets, tips)


def _parent_row(skeleton: Skeleton, name: str) -> int:
    above = skeleton.names[skeleton.parents[skeleton.index(name)]]
    if above in ("chest", "upper_chest"):
        above = "spine"
    return WALK_JOINTS.index(above)


def reduced(clip: Clip) -> Clip:
    """Return a clip of the canonical joints on `WALK_JOINTS` alone, each turned in world as it was.

    The spine takes the turn of the upper chest. Hips and legs keep their places exactly.
    """
    skeleton = joints_only(clip.skeleton)
    world = forward(clip.skeleton, clip.root_m, clip.orientation_wxyz).orientation_wxyz
    source = ["upper_chest" if name == "spine" else name for name in WALK_JOINTS]
    own = world[:, [clip.skeleton.index(name) for name in source]]
    turns = own.copy()
    turns[:, 1:] = quat_multiply(quat_conjugate(own[:, skeleton.parents[1:]]), own[:, 1:])
    return replace(clip, skeleton=skeleton, orientation_wxyz=turns)


def style_names(which: str) -> Mapping[str, WalkStyle]:
    """Return the styles of set_a or set_b by name, such as `march`, or `misery_slow`.

    Raises:
        MotionError: there is no such set.
    """
    if which == "set_a":
        return {name: style_a(name) for name in STYLES}
    if which == "set_b":
        return {f"{e}_{s}": style_b(e, s) for e in EMOTIONS for s in SPEEDS}
    raise MotionError(f"no set of walks {which!r}; there are set_a and set_b")


def walk_examples(styles: Mapping[str, WalkStyle], build: Build | None = None) -> Examples:
    """Return walks in styles as examples, on twenty joints or, with a `build`, on all 55 of a body.

    Their key moments are `WALK_KEYS`, then the end of the cycle.
    """
    body = build or build_of_skeleton(canonical_skeleton())
    walks = [styled_walk(style, body) for style in styles.values()]
    clips = [clip if build is not None else reduced(clip) for clip, _ in walks]
    heel = np.array([0.0, -body.lengths_m[p.B_ANKLE], body.lengths_m[p.B_HEEL]])
    return examples_of_clips(tuple(styles), clips, np.array([keys for _, keys in walks]), heel)


@cache
def walk_set(which: str) -> Examples:
    """Return set_a (10 styles) or set_b (9 emotions at 3 speeds) on twenty joints."""
    return walk_examples(style_names(which))

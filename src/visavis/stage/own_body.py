"""The participant's own body: a character of their size, moved by a body tracker, without a head.

The eyes look from where the head would be, so it is left out, and the body stands so that its
eyes are above or below the participant's, a little behind: nobody sees into their own collar.
"""

from dataclasses import replace

import numpy as np

from visavis.lab.geometry import Pose, Vector, quat_conjugate, quat_multiply, rotate
from visavis.lab.schema import SampleBatch
from visavis.stimuli.characters.body_parts import GROUPS, PART_INDEX
from visavis.stimuli.characters.character import MORPHS, Character, SkinnedMesh
from visavis.stimuli.characters.sizing import (
    ARM_BONES,
    LEG_BONES,
    MIN_M,
    TALLEST_M,
    scale_to_stature,
    with_limbs,
)
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.picture import Picture, PosedPeople

HIDDEN_PARTS = (*GROUPS["head"], "neck")
EYES_BEHIND_M = 0.07
FARTHEST_SHIFT_M = 0.4
"""A body farther than this from the headset is left where the tracker has it."""


class OwnBody:
    """Follow a body tracker's samples; stand in pictures as one person more.

    `segments` are the tracker's, in its order; seen `from_outside`, the body has its head. The
    size is taken from the first sample in which enough of the body is tracked: its bones against
    the character's, and the lengths of arms and legs once more by themselves.
    """

    def __init__(
        self, character: Character, segments: tuple[str, ...], *, from_outside: bool = False
    ) -> None:
        self._character = character if from_outside else headless(character)
        joints = character.skeleton.index_of
        self._joint_pairs = [(i, joints[name]) for i, name in enumerate(segments) if name in joints]
        parents = character.skeleton.parents
        sample_of = {joint: i for i, joint in self._joint_pairs}
        self._bones = [
            (i, sample_of[int(parents[j])], float(np.linalg.norm(character.skeleton.offsets_m[j])))
            for i, j in self._joint_pairs
            if int(parents[j]) in sample_of
        ]
        self._root = sample_of.get(0)
        self._sized_character: Character | None = None
        self._row: np.void | None = None

    @property
    def stature_m(self) -> float | None:
        """Stature of the avatar; None before it was measured."""
        return None if self._sized_character is None else self._sized_character.stature_m

    def take(self, batch: SampleBatch) -> None:
        """Take the tracker's newest sample; a sample with lost hips is ignored."""
        self.take_row(batch.values[-1])

    def take_row(self, row: np.void) -> None:
        """Take one sample, as recorded."""
        if self._root is None or not row["valid"][self._root]:
            return
        self._row = row
        if self._sized_character is None:
            self._measure(row)

    def add_to(self, picture: Picture, head: Pose) -> Picture:
        """Return the picture with the body in it; unchanged while nothing is tracked or lit."""
        row, character = self._row, self._sized_character
        if row is None or character is None or picture.brightness_01 <= 0.0:
            return picture
        skeleton = character.skeleton
        n = len(skeleton.names)
        turns = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        segment_of_joint = {j: i for i, j in self._joint_pairs if row["valid"][i]}
        for joint in range(n):
            if joint in segment_of_joint:
                turns[joint] = row["orientation_wxyz"][segment_of_joint[joint]].astype(np.float64)
            elif joint:
                turns[joint] = turns[skeleton.parents[joint]]
        local = turns.copy()
        local[1:] = quat_multiply(quat_conjugate(turns[skeleton.parents[1:]]), turns[1:])
        root = row["position_m"][self._root].astype(np.float64)
        root = root + self._shift(character, root, local, head)
        people = picture.people
        mine = np.zeros((1, len(MORPHS)))
        return replace(
            picture,
            cast=(*picture.cast, character),
            people=PosedPeople(
                np.concatenate([people.root_m, root[None]]),
                np.concatenate([people.orientation_wxyz, local[None]]),
                np.concatenate([people.morphs_01, mine]),
            ),
        )

    # ---- private --------------------------------------------------------------------------

    def _measure(self, row: np.void) -> None:
        total_m, usual = 0.0, 0.0
        for child, parent, length_m in self._bones:
            if row["valid"][child] and row["valid"][parent]:
                bone = row["position_m"][child] - row["position_m"][parent]
                total_m += float(np.linalg.norm(bone))
                usual += length_m
        size = total_m / usual if usual > 0.5 else 0.0
        stature_m = self._character.stature_m * size
        if MIN_M <= stature_m <= TALLEST_M:
            body = scale_to_stature(self._character, round(stature_m, 3))
            arms, legs = (self._of_limbs(row, names, size) for names in (ARM_BONES, LEG_BONES))
            self._sized_character = with_limbs(body, arms, legs)

    def _of_limbs(self, row: np.void, names: tuple[str, ...], size: float) -> float:
        """Return how much longer these bones are than in a body of this size; 1 if not tracked."""
        skeleton = self._character.skeleton
        sample_of = {joint: i for i, joint in self._joint_pairs}
        total_m, usual = 0.0, 0.0
        for joint, name in enumerate(skeleton.names):
            parent = int(skeleton.parents[joint])
            if not name.endswith(names) or joint not in sample_of or parent not in sample_of:
                continue
            child, above = sample_of[joint], sample_of[parent]
            if row["valid"][child] and row["valid"][above]:
                bone = row["position_m"][child] - row["position_m"][above]
                total_m += float(np.linalg.norm(bone))
                usual += size * float(np.linalg.norm(skeleton.offsets_m[joint]))
        return round(total_m / usual, 3) if usual > 0.0 else 1.0

    @staticmethod
    def _shift(character: Character, root: Vector, local: Vector, head: Pose) -> Vector:
        """Return the way (3,) on the floor that brings the body's eyes behind the headset."""
        skeleton = character.skeleton
        pose = forward(skeleton, root[None], local[None])
        eyes = [skeleton.index_of[name] for name in ("left_eye", "right_eye")]
        middle = pose.position_m[0, eyes].mean(axis=0)
        backward = rotate(local[0], np.array([0.0, 0.0, EYES_BEHIND_M]))
        shift: Vector = (head.position_m + backward - middle) * np.array([1.0, 0.0, 1.0])
        return shift if np.linalg.norm(shift) <= FARTHEST_SHIFT_M else np.zeros(3)


def headless(character: Character) -> Character:
    """Return a character without head and neck; everything else is as it was."""
    hidden_parts = [PART_INDEX[part] for part in HIDDEN_PARTS]
    levels, measuring = (
        tuple(_without(mesh, hidden_parts) for mesh in meshes)
        for meshes in (character.levels, character.measuring)
    )
    name = f"{character.name}_headless"
    return replace(character, name=name, levels=levels, measuring=measuring)


def _without(mesh: SkinnedMesh, hidden_parts: list[int]) -> SkinnedMesh:
    is_visible = ~np.isin(mesh.triangle_part, hidden_parts)
    return replace(
        mesh,
        triangles=mesh.triangles[is_visible],
        triangle_part=mesh.triangle_part[is_visible],
        triangle_material=mesh.triangle_material[is_visible],
    )

"""Walks of other programs: joints are known by their conventions, oddities are told."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.motion.motions import CANONICAL, wandering
from visavis.stimuli.motion.bvh import Bvh, format_bvh, parse_bvh, read_bvh, write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip, clip_of_bvh
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import UnknownJointsError
from visavis.stimuli.motion.joint_names import NEEDED, match_joints
from visavis.stimuli.motion.motion_file import read_motion
from visavis.stimuli.motion.retarget import retarget, retargeting_error
from visavis.stimuli.motion.skeleton import Skeleton

FILES = Path(__file__).parent / "files" / "bvh"
KINECT = {
    "hips": "PELVIS",
    "spine": "SPINE_NAVEL",
    "upper_chest": "SPINE_CHEST",
    "neck": "NECK",
    "head": "HEAD",
    **{
        f"{side}_{ours}": f"{theirs}_{side.upper()}"
        for side in ("left", "right")
        for ours, theirs in {
            "shoulder": "CLAVICLE",
            "upper_arm": "SHOULDER",
            "lower_arm": "ELBOW",
            "hand": "WRIST",
            "upper_leg": "HIP",
            "lower_leg": "KNEE",
            "foot": "ANKLE",
        }.items()
    },
}


def walk() -> Clip:
    return wandering(np.random.default_rng(5))


def renamed(name_of: dict[str, str]) -> Clip:
    """A walk of ours on a skeleton with only these joints, called so."""
    clip = walk()
    stays = [j for j, name in enumerate(CANONICAL.names) if name in name_of]
    parents, offsets = [], []
    for j in stays:
        at, offset = int(CANONICAL.parents[j]), CANONICAL.offsets_m[j].copy()
        while at != -1 and at not in stays:
            offset, at = offset + CANONICAL.offsets_m[at], int(CANONICAL.parents[at])
        parents.append(stays.index(at) if at != -1 else -1)
        offsets.append(offset)
    names = tuple(name_of[CANONICAL.names[j]] for j in stays)
    skeleton = Skeleton(names, np.array(parents), np.array(offsets), CANONICAL.tips_m[stays])
    return Clip(skeleton, clip.frame_s, clip.root_m, clip.orientation_wxyz[:, stays])


@pytest.mark.parametrize("name", ["side_at_the_end.bvh", "suffix_jnt.bvh"])
def test_the_files_are_carried_over(name: str) -> None:
    clip = clip_of_bvh(read_bvh(FILES / name), unit_m=0.01)
    result = retarget(clip)
    assert retargeting_error(clip, result).direction_deg.max() < 1e-3


@settings(max_examples=40, deadline=None)
@given(
    where=st.sampled_from(["{side}_{part}", "{part}_{side}", "{side}{part}", "{part}{side}"]),
    ending=st.sampled_from(["", "_JNT", "_jnt", "_Joint", ".001", "_JNT.001", "Jnt", "_bone"]),
    prefix=st.sampled_from(["", "mixamorig:", "Character1_"]),
    case=st.sampled_from([str, str.upper, str.title]),
)
def test_sides_stand_before_or_behind_and_endings_do_not_count(
    where: str, ending: str, prefix: str, case: type[str]
) -> None:
    parts = ("arm", "forearm", "hand", "upleg", "leg", "foot")
    names = {"hips": "hips", "spine": "spine", "head": "head"} | {
        needed: where.format(side=needed.partition("_")[0], part=part)
        for needed, part in zip(NEEDED, (*parts, *parts), strict=True)
    }
    spelt = {ours: f"{prefix}{case(name)}{ending}" for ours, name in names.items()}
    matches = match_joints(renamed(spelt).skeleton)
    for ours in (*NEEDED, "hips", "head"):
        assert spelt[ours] == matches[ours]


def test_joints_of_kinect_are_known() -> None:
    matches = match_joints(renamed(KINECT).skeleton)
    for ours in (*NEEDED, "hips", "head", "neck", "left_shoulder"):
        assert KINECT[ours] == matches[ours]


def test_joints_of_no_convention_are_named_in_a_map(tmp_path: Path) -> None:
    strange = {ours: f"node{i}" for i, ours in enumerate((*NEEDED, "hips", "spine", "head"))}
    clip = renamed(strange)
    write_bvh(tmp_path / "a.bvh", bvh_of_clip(clip))
    with pytest.raises(UnknownJointsError):
        read_motion(tmp_path / "a.bvh", CANONICAL)
    names = {ours: strange[ours] for ours in (*NEEDED, "head")}
    motion = read_motion(tmp_path / "a.bvh", CANONICAL, joint_names=names)
    assert len(clip.root_m) == len(motion.root_m)


def told(path: Path, bvh: Bvh) -> list[str]:
    write_bvh(path, bvh)
    texts: list[str] = []
    read_motion(path, CANONICAL, tell=texts.append)
    return texts


def test_a_sound_motion_has_nothing_to_tell(tmp_path: Path) -> None:
    assert [] == told(tmp_path / "a.bvh", bvh_of_clip(walk()))


def test_frames_of_zeros_are_told(tmp_path: Path) -> None:
    bvh = bvh_of_clip(walk())
    values = bvh.values.copy()
    values[5:9] = 0
    texts = told(tmp_path / "a.bvh", Bvh(bvh.joints, bvh.frame_time_s, values))
    assert any("4 frames hold zeros alone, the first is frame 6" in text for text in texts)


def test_a_mirrored_export_is_told(tmp_path: Path) -> None:
    other = {"left": "right", "right": "left"}
    swapped = {
        name: other[name.partition("_")[0]] + "_" + name.partition("_")[2]
        if name.partition("_")[0] in other
        else name
        for name in CANONICAL.names
    }
    texts = told(tmp_path / "a.bvh", bvh_of_clip(renamed(swapped)))
    assert any("feet point backwards" in text for text in texts)


def test_speeds_beyond_a_persons_are_told(tmp_path: Path) -> None:
    bvh = bvh_of_clip(walk())
    values = bvh.values.copy()
    values[len(values) // 2 :, 0] += 300  # three metres, from one frame to the next
    texts = told(tmp_path / "a.bvh", Bvh(bvh.joints, bvh.frame_time_s, values))
    assert any("faster than a person" in text for text in texts)


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n"])
def test_every_end_of_line_and_a_blank_before_the_colon_are_read(end: str) -> None:
    bvh = bvh_of_clip(walk())
    text = format_bvh(bvh).replace("Frames:", "Frames :").replace("Frame Time:", "Frame Time :")
    assert np.array_equal(bvh.values, parse_bvh(text.replace("\n", end)).values)

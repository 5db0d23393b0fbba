"""Retargeting: a known motion put on foreign skeletons comes back."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.stimuli.motion.motions import CANONICAL, wandering
from tests.stimuli.motion.rotation_cases import random_quats, same, seeds
from visavis.lab.geometry import (
    Vector,
    quat_conjugate,
    quat_from_yaw_pitch_deg,
    quat_multiply,
    rotate,
    unit,
)
from visavis.stimuli.motion.bvh import format_bvh, parse_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip, clip_of_bvh
from visavis.stimuli.motion.clip import Clip, placed_joints, worn_by
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_names import match_joints
from visavis.stimuli.motion.retarget import LIMB_BONES, retarget, retargeting_error
from visavis.stimuli.motion.rotations import quat_between, quat_exp
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton, forward, local_of_world

quick = settings(max_examples=15, deadline=None)
IDENTITY_MAP = {name: name for name in CANONICAL.names}
DOWN, ACROSS = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])

AXES = {
    "as ours": np.array([1.0, 0, 0, 0]),
    "facing +z": np.array([0.0, 0, 1, 0]),
    "facing +x": quat_from_yaw_pitch_deg(90.0),
    "z up": quat_exp(np.array([-np.pi / 4, 0, 0])),
}
"""Turns from the source's axes to ours."""


def on_foreign_skeleton(clip: Clip, to_ours: Vector, rests: Vector, stretch: Vector) -> Clip:
    """Put a canonical motion on a skeleton with other axes, rest pose and bone lengths.

    `rests` (n, 4) turn each joint's bones at its rest, `stretch` (n,) lengthens the bone to it.
    """
    skeleton = clip.skeleton
    to_theirs = quat_conjugate(to_ours)
    world = forward(skeleton, clip.root_m, clip.orientation_wxyz).orientation_wxyz
    theirs = quat_multiply(
        to_theirs, quat_multiply(world, quat_multiply(quat_conjugate(rests), to_ours))
    )
    offsets = np.zeros_like(skeleton.offsets_m)
    for j in range(1, len(offsets)):
        at_rest = rotate(rests[skeleton.parents[j]], stretch[j] * skeleton.offsets_m[j])
        offsets[j] = rotate(to_theirs, at_rest)
    foreign = Skeleton(skeleton.names, skeleton.parents, offsets, skeleton.tips_m)
    root = rotate(to_theirs, clip.root_m)
    return Clip(foreign, clip.frame_s, root, local_of_world(foreign, theirs))


def rests_of(towards: dict[str, Vector]) -> Vector:
    """Return rest turns that lay limb bones along directions; hands and feet follow."""
    rests = np.tile([1.0, 0, 0, 0], (len(CANONICAL.names), 1))
    for a, b in LIMB_BONES:
        part = a.split("_", 1)[1]
        if part in towards:
            side = np.array([-1.0 if a.startswith("left") else 1.0, 1.0, 1.0])
            ours = unit(CANONICAL.offsets_m[CANONICAL.index(b)])
            rests[CANONICAL.index(a)] = quat_between(ours, unit(side * towards[part]))
    for j, name in enumerate(CANONICAL.names):
        if any(x in name for x in ("hand", "foot", "toes", "proximal", "middle", "distal")):
            rests[j] = rests[CANONICAL.parents[j]]
    return rests


A_POSE = {"upper_arm": ACROSS + 0.8 * DOWN, "lower_arm": ACROSS + 0.8 * DOWN}
STRADDLED = {"upper_leg": 0.36 * ACROSS + DOWN, "lower_leg": 0.36 * ACROSS + DOWN}


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("towards", [{}, A_POSE, STRADDLED, A_POSE | STRADDLED])
def test_motion_on_a_foreign_skeleton_comes_back(axes: str, towards: dict[str, Vector]) -> None:
    clip = wandering(np.random.default_rng(11), 12)
    source = on_foreign_skeleton(clip, AXES[axes], rests_of(towards), np.ones(55))

    result = retarget(source, CANONICAL)

    assert same(clip.orientation_wxyz, result.orientation_wxyz, 1e-9)
    assert np.abs(clip.root_m - result.root_m).max() < 1e-9


@quick
@given(seeds)
def test_any_rest_pose_is_undone_by_a_frame_in_which_the_person_stands_straight(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clip = wandering(rng, 6)
    clip.orientation_wxyz[2] = [1.0, 0, 0, 0]
    clip.orientation_wxyz[2, 0] = quat_from_yaw_pitch_deg(float(rng.uniform(-44, 44)))
    source = on_foreign_skeleton(clip, AXES["facing +z"], random_quats(rng, 55), np.ones(55))

    result = retarget(source, CANONICAL, joint_map=IDENTITY_MAP, reference_frame=2)

    assert same(clip.orientation_wxyz, result.orientation_wxyz, 1e-9)
    assert np.abs(clip.root_m - result.root_m).max() < 1e-9


@quick
@given(seeds)
def test_other_limb_lengths_keep_every_direction(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clip = wandering(rng, 10)
    rests = rests_of(A_POSE | STRADDLED)
    source = on_foreign_skeleton(clip, AXES["z up"], rests, rng.uniform(0.6, 1.5, 55))

    result = retarget(source, CANONICAL)
    error = retargeting_error(source, result)

    assert same(clip.orientation_wxyz, result.orientation_wxyz, 1e-9)
    assert error.direction_deg.max() < 1e-9
    # Thigh and shin of another proportion: the end of the limb can differ by their difference.
    assert error.reach_01.max() < 0.25


def test_error_of_the_same_body_is_zero_and_of_a_bent_elbow_its_angle() -> None:
    clip = wandering(np.random.default_rng(12), 5)
    bent = clip.orientation_wxyz.copy()
    elbow = CANONICAL.index("left_lower_arm")
    bend = quat_exp(np.array([0.0, np.radians(10.0) / 2, 0.0]))
    bent[:, elbow] = quat_multiply(bent[:, elbow], bend)

    none = retargeting_error(clip, clip)
    some = retargeting_error(clip, replace(clip, orientation_wxyz=bent))

    assert none.direction_deg.max() < 1e-9
    assert none.reach_01.max() < 1e-12
    assert pytest.approx(10.0) == some.direction_deg[:, 1].max()
    assert some.direction_deg[:, [0, 2, 3, 4, 5, 6, 7]].max() < 1e-9
    assert some.reach_01[:, 0].min() > 0.01 > 1e-9 > some.reach_01[:, 1:].max()


def test_root_is_scaled_with_the_legs() -> None:
    clip = wandering(np.random.default_rng(13), 6)

    small = retarget(clip, canonical_skeleton(0.875))

    assert np.allclose(worn_by(clip, canonical_skeleton(0.875)).root_m, small.root_m, atol=1e-9)


def test_bvh_of_centimetres_facing_the_other_way_is_carried_over() -> None:
    clip = wandering(np.random.default_rng(14), 12)
    source = on_foreign_skeleton(clip, AXES["facing +z"], rests_of(STRADDLED), np.ones(55))
    text = format_bvh(bvh_of_clip(source, order="XZY"), decimals=6)

    result = retarget(clip_of_bvh(parse_bvh(text), unit_m=0.01))

    expected = placed_joints(clip, clip.frame_times_s).position_m
    assert np.abs(expected - placed_joints(result, clip.frame_times_s).position_m).max() < 1e-5


def tree(text: str) -> Skeleton:
    """Return a skeleton of `name>child` chains separated by blanks."""
    names: list[str] = []
    parents: list[int] = []
    for chain in text.split():
        above = -1
        for name in chain.split(">"):
            if name not in names:
                names.append(name)
                parents.append(above)
            above = names.index(name)
    n = len(names)
    return Skeleton(
        tuple(names), np.array(parents), np.arange(3.0 * n).reshape(n, 3), np.zeros((n, 3))
    )


CONVENTIONS = {
    "cmu": (
        "Hips>LowerBack>Spine>Spine1>Neck>Neck1>Head Spine1>LeftShoulder>LeftArm>LeftForeArm"
        ">LeftHand>LeftFingerBase Spine1>RightShoulder>RightArm>RightForeArm>RightHand>RThumb "
        "Hips>LHipJoint>LeftUpLeg>LeftLeg>LeftFoot>LeftToeBase "
        "Hips>RHipJoint>RightUpLeg>RightLeg>RightFoot>RightToeBase",
        {"hips": "Hips", "spine": "LowerBack", "chest": "Spine", "upper_chest": "Spine1",
         "neck": "Neck1", "left_upper_leg": "LeftUpLeg", "right_lower_leg": "RightLeg",
         "left_toes": "LeftToeBase", "left_shoulder": "LeftShoulder", "right_hand": "RightHand"},
    ),
    "asf": (
        "root>lowerback>upperback>thorax>lowerneck>upperneck>head "
        "thorax>lclavicle>lhumerus>lradius>lwrist>lhand thorax>rclavicle>rhumerus>rradius>rwrist "
        "root>lhipjoint>lfemur>ltibia>lfoot>ltoes root>rhipjoint>rfemur>rtibia>rfoot>rtoes",
        {"hips": "root", "spine": "lowerback", "chest": "upperback", "upper_chest": "thorax",
         "neck": "upperneck", "left_upper_arm": "lhumerus", "right_hand": "rwrist",
         "left_upper_leg": "lfemur", "right_toes": "rtoes", "left_shoulder": "lclavicle"},
    ),
    "mixamo": (
        "mixamorig:Hips>mixamorig:Spine>mixamorig:Spine1>mixamorig:Spine2>mixamorig:Neck"
        ">mixamorig:Head mixamorig:Spine2>mixamorig:LeftShoulder>mixamorig:LeftArm"
        ">mixamorig:LeftForeArm>mixamorig:LeftHand>mixamorig:LeftHandIndex1"
        ">mixamorig:LeftHandIndex2 mixamorig:LeftHand>mixamorig:LeftHandPinky1 "
        "mixamorig:Spine2>mixamorig:RightShoulder>mixamorig:RightArm>mixamorig:RightForeArm"
        ">mixamorig:RightHand mixamorig:Hips>mixamorig:LeftUpLeg>mixamorig:LeftLeg"
        ">mixamorig:LeftFoot mixamorig:Hips>mixamorig:RightUpLeg>mixamorig:RightLeg"
        ">mixamorig:RightFoot",
        {"upper_chest": "mixamorig:Spine2", "neck": "mixamorig:Neck",
         "left_index_middle": "mixamorig:LeftHandIndex2",
         "left_little_proximal": "mixamorig:LeftHandPinky1"},
    ),
    "bandai": (
        "joint_Root>Hips>Spine>Chest>Neck>Head Chest>Shoulder_L>UpperArm_L>LowerArm_L>Hand_L "
        "Chest>Shoulder_R>UpperArm_R>LowerArm_R>Hand_R Hips>UpperLeg_L>LowerLeg_L>Foot_L>Toes_L "
        "Hips>UpperLeg_R>LowerLeg_R>Foot_R>Toes_R",
        {"hips": "Hips", "spine": "Spine", "upper_chest": "Chest", "neck": "Neck",
         "left_upper_arm": "UpperArm_L", "right_toes": "Toes_R", "right_shoulder": "Shoulder_R"},
    ),
    "biovision": (
        "Hips>Chest>Neck>Head Chest>LeftCollar>LeftShoulder>LeftElbow>LeftWrist "
        "Chest>RightCollar>RightShoulder>RightElbow>RightWrist "
        "Hips>LeftHip>LeftKnee>LeftAnkle Hips>RightHip>RightKnee>RightAnkle",
        {"upper_chest": "Chest", "left_shoulder": "LeftCollar", "left_upper_arm": "LeftShoulder",
         "left_lower_arm": "LeftElbow", "left_hand": "LeftWrist", "right_upper_leg": "RightHip",
         "right_lower_leg": "RightKnee", "right_foot": "RightAnkle"},
    ),
    "mixamo, written by three.js": (
        "mixamorigHips>mixamorigSpine>mixamorigSpine1>mixamorigSpine2>mixamorigNeck>mixamorigHead"
        ">mixamorigLeftEye "
        "mixamorigSpine2>mixamorigLeftShoulder>mixamorigLeftArm>mixamorigLeftForeArm"
        ">mixamorigLeftHand>mixamorigLeftHandThumb1 "
        "mixamorigSpine2>mixamorigRightShoulder>mixamorigRightArm>mixamorigRightForeArm"
        ">mixamorigRightHand mixamorigHips>mixamorigLeftUpLeg>mixamorigLeftLeg"
        ">mixamorigLeftFoot>mixamorigLeftToeBase mixamorigHips>mixamorigRightUpLeg"
        ">mixamorigRightLeg>mixamorigRightFoot",
        {"hips": "mixamorigHips", "chest": "mixamorigSpine1", "left_eye": "mixamorigLeftEye",
         "left_thumb_proximal": "mixamorigLeftHandThumb1", "left_toes": "mixamorigLeftToeBase"},
    ),
    "ready player me": (
        "Hips>Spine>Spine1>Spine2>Neck>Head>LeftEye Head>RightEye Head>HeadTop_End "
        "Spine2>LeftShoulder>LeftArm>LeftForeArm>LeftHand>LeftHandIndex1>LeftHandIndex2"
        ">LeftHandIndex3>LeftHandIndex4 Spine2>RightShoulder>RightArm>RightForeArm>RightHand "
        "Hips>LeftUpLeg>LeftLeg>LeftFoot>LeftToeBase>LeftToe_End "
        "Hips>RightUpLeg>RightLeg>RightFoot>RightToeBase",
        {"right_eye": "RightEye", "left_index_distal": "LeftHandIndex3", "head": "Head",
         "left_toes": "LeftToeBase", "upper_chest": "Spine2", "neck": "Neck"},
    ),
    "biped, as in rocketbox": (
        "Bip01>Bip01_Pelvis>Bip01_Spine>Bip01_Spine1>Bip01_Spine2>Bip01_Neck>Bip01_Head"
        ">Bip01_LEye Bip01_Head>Bip01_REye Bip01_Head>Bip01_MJaw "
        "Bip01_Neck>Bip01_L_Clavicle>Bip01_L_UpperArm>Bip01_L_Forearm>Bip01_L_Hand"
        ">Bip01_L_Finger0>Bip01_L_Finger01>Bip01_L_Finger02 Bip01_L_Hand>Bip01_L_Finger4 "
        "Bip01_Neck>Bip01_R_Clavicle>Bip01_R_UpperArm>Bip01_R_Forearm>Bip01_R_Hand "
        "Bip01_Pelvis>Bip01_L_Thigh>Bip01_L_Calf>Bip01_L_Foot>Bip01_L_Toe0 "
        "Bip01_Pelvis>Bip01_R_Thigh>Bip01_R_Calf>Bip01_R_Foot>Bip01_R_Toe0",
        {"hips": "Bip01_Pelvis", "spine": "Bip01_Spine", "chest": "Bip01_Spine1",
         "upper_chest": "Bip01_Spine2", "neck": "Bip01_Neck", "jaw": "Bip01_MJaw",
         "left_eye": "Bip01_LEye", "left_shoulder": "Bip01_L_Clavicle",
         "right_upper_arm": "Bip01_R_UpperArm", "left_thumb_proximal": "Bip01_L_Finger0",
         "left_thumb_distal": "Bip01_L_Finger02", "left_little_proximal": "Bip01_L_Finger4",
         "right_lower_leg": "Bip01_R_Calf", "right_toes": "Bip01_R_Toe0"},
    ),
    "vroid": (
        "Root>J_Bip_C_Hips>J_Bip_C_Spine>J_Bip_C_Chest>J_Bip_C_UpperChest>J_Bip_C_Neck"
        ">J_Bip_C_Head>J_Adj_L_FaceEye J_Bip_C_UpperChest>J_Bip_L_Shoulder>J_Bip_L_UpperArm"
        ">J_Bip_L_LowerArm>J_Bip_L_Hand>J_Bip_L_Index1 J_Bip_C_UpperChest>J_Bip_R_Shoulder"
        ">J_Bip_R_UpperArm>J_Bip_R_LowerArm>J_Bip_R_Hand "
        "J_Bip_C_Hips>J_Bip_L_UpperLeg>J_Bip_L_LowerLeg>J_Bip_L_Foot>J_Bip_L_ToeBase "
        "J_Bip_C_Hips>J_Bip_R_UpperLeg>J_Bip_R_LowerLeg>J_Bip_R_Foot",
        {"hips": "J_Bip_C_Hips", "head": "J_Bip_C_Head", "left_eye": "J_Adj_L_FaceEye",
         "left_index_proximal": "J_Bip_L_Index1", "left_toes": "J_Bip_L_ToeBase",
         "right_lower_arm": "J_Bip_R_LowerArm"},
    ),
    "cmu, as in makehuman": (
        "Hips>LowerBack>Spine>Spine1>Neck>Neck1>Head Spine1>LeftShoulder>LeftArm>LeftForeArm"
        ">LeftHand>LeftFingerBase Spine1>RightShoulder>RightArm>RightForeArm>RightHand "
        "Hips>LHipJoint>LeftUpLeg>LeftLeg>LeftFoot>LeftToeBase "
        "Hips>RHipJoint>RightUpLeg>RightLeg>RightFoot",
        {"hips": "Hips", "spine": "LowerBack", "upper_chest": "Spine1", "neck": "Neck1",
         "left_upper_leg": "LeftUpLeg", "left_upper_arm": "LeftArm"},
    ),
    "unreal": (
        "root>pelvis>spine_01>spine_02>spine_03>neck_01>head "
        "spine_03>clavicle_l>upperarm_l>lowerarm_l>hand_l>index_01_l>index_02_l "
        "spine_03>clavicle_r>upperarm_r>lowerarm_r>hand_r "
        "pelvis>thigh_l>calf_l>foot_l>ball_l pelvis>thigh_r>calf_r>foot_r>ball_r",
        {"hips": "pelvis", "upper_chest": "spine_03", "left_toes": "ball_l",
         "left_index_middle": "index_02_l", "right_lower_leg": "calf_r"},
    ),
    "character creator": (
        "CC_Base_BoneRoot>CC_Base_Hip>CC_Base_Pelvis CC_Base_Hip>CC_Base_Waist>CC_Base_Spine01"
        ">CC_Base_Spine02>CC_Base_NeckTwist01>CC_Base_NeckTwist02>CC_Base_Head"
        ">CC_Base_FacialBone>CC_Base_JawRoot CC_Base_FacialBone>CC_Base_L_Eye "
        "CC_Base_FacialBone>CC_Base_R_Eye "
        "CC_Base_Spine02>CC_Base_L_Clavicle>CC_Base_L_Upperarm>CC_Base_L_UpperarmTwist01 "
        "CC_Base_L_Upperarm>CC_Base_L_Forearm>CC_Base_L_Hand>CC_Base_L_Mid1>CC_Base_L_Mid2 "
        "CC_Base_Spine02>CC_Base_R_Clavicle>CC_Base_R_Upperarm>CC_Base_R_Forearm>CC_Base_R_Hand "
        "CC_Base_Pelvis>CC_Base_L_Thigh>CC_Base_L_ThighTwist01 CC_Base_L_Thigh>CC_Base_L_Calf"
        ">CC_Base_L_Foot>CC_Base_L_ToeBase "
        "CC_Base_Pelvis>CC_Base_R_Thigh>CC_Base_R_Calf>CC_Base_R_Foot>CC_Base_R_ToeBase",
        {"hips": "CC_Base_Hip", "spine": "CC_Base_Waist", "upper_chest": "CC_Base_Spine02",
         "neck": "CC_Base_NeckTwist02", "jaw": "CC_Base_JawRoot", "left_eye": "CC_Base_L_Eye",
         "left_upper_arm": "CC_Base_L_Upperarm", "left_middle_middle": "CC_Base_L_Mid2",
         "left_upper_leg": "CC_Base_L_Thigh", "right_toes": "CC_Base_R_ToeBase"},
    ),
    "daz": (
        "hip>pelvis hip>abdomenLower>abdomenUpper>chestLower>chestUpper>neckLower>neckUpper>head"
        ">lEye head>rEye head>lowerJaw chestUpper>lCollar>lShldrBend>lShldrTwist>lForearmBend"
        ">lForearmTwist>lHand>lMid1 "
        "chestUpper>rCollar>rShldrBend>rShldrTwist>rForearmBend>rForearmTwist>rHand "
        "pelvis>lThighBend>lThighTwist>lShin>lFoot>lMetatarsals>lToe "
        "pelvis>rThighBend>rThighTwist>rShin>rFoot>rMetatarsals>rToe",
        {"hips": "hip", "spine": "abdomenLower", "upper_chest": "chestUpper", "jaw": "lowerJaw",
         "left_upper_arm": "lShldrBend", "right_lower_arm": "rForearmBend", "left_eye": "lEye",
         "left_upper_leg": "lThighBend", "right_lower_leg": "rShin", "left_toes": "lToe",
         "left_middle_proximal": "lMid1", "left_shoulder": "lCollar"},
    ),
    "makehuman": (
        "root>spine05>spine04>spine03>spine02>spine01>neck01>neck02>neck03>head>jaw head>eye.L "
        "spine01>clavicle.L>shoulder01.L>upperarm01.L>upperarm02.L>lowerarm01.L>lowerarm02.L"
        ">wrist.L>finger1-1.L>finger1-2.L wrist.L>finger3-1.L "
        "spine01>clavicle.R>shoulder01.R>upperarm01.R>upperarm02.R>lowerarm01.R>lowerarm02.R"
        ">wrist.R "
        "root>pelvis.L>upperleg01.L>upperleg02.L>lowerleg01.L>lowerleg02.L>foot.L>toe1-1.L "
        "root>pelvis.R>upperleg01.R>upperleg02.R>lowerleg01.R>lowerleg02.R>foot.R",
        {"hips": "root", "spine": "spine05", "upper_chest": "spine01", "neck": "neck03",
         "left_eye": "eye.L", "left_shoulder": "clavicle.L", "left_upper_arm": "upperarm01.L",
         "right_lower_arm": "lowerarm01.R", "left_hand": "wrist.L",
         "left_upper_leg": "upperleg01.L", "right_lower_leg": "lowerleg01.R",
         "left_thumb_middle": "finger1-2.L", "left_middle_proximal": "finger3-1.L"},
    ),
    "smpl-x": (
        "pelvis>spine1>spine2>spine3>neck>head>left_eye_smplhf head>right_eye_smplhf "
        "spine3>left_collar>left_shoulder>left_elbow>left_wrist>left_index1 "
        "spine3>right_collar>right_shoulder>right_elbow>right_wrist "
        "pelvis>left_hip>left_knee>left_ankle>left_foot pelvis>right_hip>right_knee>right_ankle",
        {"left_eye": "left_eye_smplhf", "right_eye": "right_eye_smplhf", "left_foot": "left_ankle",
         "left_upper_arm": "left_shoulder", "left_shoulder": "left_collar"},
    ),
    "vrchat": (
        "Hips>Spine>Chest>Neck>Head>LeftEye Head>RightEye "
        "Chest>Left_shoulder>Left_arm>Left_elbow>Left_wrist "
        "Chest>Right_shoulder>Right_arm>Right_elbow>Right_wrist "
        "Hips>Left_leg>Left_knee>Left_ankle>Left_toe Hips>Right_leg>Right_knee>Right_ankle",
        {"left_upper_arm": "Left_arm", "left_lower_arm": "Left_elbow", "left_hand": "Left_wrist",
         "left_upper_leg": "Left_leg", "right_lower_leg": "Right_knee", "left_toes": "Left_toe"},
    ),
    "rigify, written by autodesk's exporter": (
        "hips>chest>neck>head chest>shoulderFBXASC046L>upper_armFBXASC046L>forearmFBXASC046L"
        ">handFBXASC046L>f_indexFBXASC04601FBXASC046L "
        "chest>shoulderFBXASC046R>upper_armFBXASC046R>forearmFBXASC046R>handFBXASC046R "
        "hips>thighFBXASC046L>shinFBXASC046L>footFBXASC046L>toeFBXASC046L "
        "hips>thighFBXASC046R>shinFBXASC046R>footFBXASC046R",
        {"left_upper_arm": "upper_armFBXASC046L", "right_lower_leg": "shinFBXASC046R",
         "left_index_proximal": "f_indexFBXASC04601FBXASC046L", "left_toes": "toeFBXASC046L"},
    ),
    "mixamo, numbered by sketchfab": (
        "_rootJoint>mixamorig:Hips_01>mixamorig:Spine_02>mixamorig:Neck_03>mixamorig:Head_04 "
        "mixamorig:Spine_02>mixamorig:LeftArm_09>mixamorig:LeftForeArm_010>mixamorig:LeftHand_011"
        ">mixamorig:LeftHandIndex1_012 "
        "mixamorig:Spine_02>mixamorig:RightArm_00>mixamorig:RightForeArm_021"
        ">mixamorig:RightHand_022 "
        "mixamorig:Hips_01>mixamorig:LeftUpLeg_055>mixamorig:LeftLeg_056>mixamorig:LeftFoot_057 "
        "mixamorig:Hips_01>mixamorig:RightUpLeg_060>mixamorig:RightLeg_061"
        ">mixamorig:RightFoot_062",
        {"head": "mixamorig:Head_04", "left_hand": "mixamorig:LeftHand_011",
         "left_index_proximal": "mixamorig:LeftHandIndex1_012",
         "right_foot": "mixamorig:RightFoot_062"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_joints_of_common_conventions_are_recognised(convention: str) -> None:
    text, expected = CONVENTIONS[convention]

    match = match_joints(tree(text))

    assert expected == {name: match.get(name) for name in expected}


def test_joints_may_be_said_over_what_their_names_tell() -> None:
    text, _ = CONVENTIONS["bandai"]
    plain = tree(text.replace("Head", "Kopf"))
    with pytest.raises(MotionError, match="head"):
        match_joints(plain)
    match = match_joints(plain, {"head": "Kopf", "hips": "joint_Root"})
    assert (match["head"], match["hips"], match["neck"]) == ("Kopf", "joint_Root", "Neck")
    with pytest.raises(MotionError, match="no joint 'Fuss', said to be left_foot"):
        match_joints(plain, {"head": "Kopf", "left_foot": "Fuss"})
    with pytest.raises(MotionError, match="no joint of ours is called 'kopf'"):
        match_joints(plain, {"kopf": "Kopf"})


def test_our_own_joints_are_recognised_all() -> None:
    match = match_joints(CANONICAL)

    assert IDENTITY_MAP == dict(match)


def test_joints_that_cannot_be_recognised_are_named() -> None:
    with pytest.raises(MotionError, match=r"left_upper_arm.*joint_map"):
        match_joints(tree("Hips>Tail Hips>Head"))
    clip = wandering(np.random.default_rng(15), 3)
    with pytest.raises(MotionError, match="lacks"):
        retarget(clip, joint_map={"hips": "hips"})
    with pytest.raises(MotionError, match="no joint 'paw'"):
        retarget(clip, joint_map=IDENTITY_MAP | {"left_hand": "paw"})
    with pytest.raises(MotionError, match="left_hand and right_hand are both said to be"):
        match_joints(CANONICAL, {"left_hand": "right_hand", "right_hand": "right_hand"})
    with pytest.raises(MotionError, match="reference frame 3"):
        retarget(clip, reference_frame=3)


@quick
@given(seeds, st.sampled_from(["left_lower_arm", "right_foot", "head"]))
def test_source_with_joints_in_one_place_is_refused(seed: int, collapsed: str) -> None:
    clip = wandering(np.random.default_rng(seed), 3)
    offsets = CANONICAL.offsets_m.copy()
    j = CANONICAL.index(collapsed)
    while j > 0 and (collapsed == "head" or CANONICAL.names[j] == collapsed):
        offsets[j] = 0.0
        j = int(CANONICAL.parents[j])
    if collapsed == "head":
        for side in ("left", "right"):
            offsets[CANONICAL.index(f"{side}_upper_leg")] = 0.0

    with pytest.raises(MotionError, match="in one place"):
        retarget(replace(clip, skeleton=replace(CANONICAL, offsets_m=offsets)), CANONICAL)

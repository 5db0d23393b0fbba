"""Retarget a recorded motion to the canonical skeleton, for any axes and bones of the source.

Every joint follows the source joint's orientation in world. At one reference pose (all channels
zero, or a frame of the clip) limb bones are laid along the source's bones by the smallest turn
from our T-pose; after that they keep that angle, so directions of limb bones are carried over
exactly and twist follows the source. Trunk, neck and head take the reference pose as upright.
Hands, feet, toes and fingers keep the angle against their limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from visavis.lab.geometry import Vector, angle_deg, quat_conjugate, quat_multiply, rotate, unit
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.joint_names import NEEDED, match_joints
from visavis.stimuli.motion.rotations import IDENTITY, continuous, quat_between, quat_from_axes
from visavis.stimuli.motion.skeleton import (
    Placement,
    Skeleton,
    canonical_skeleton,
    forward,
    local_of_world,
)

LIMB_BONES = tuple(
    (f"{side}_{a}", f"{side}_{b}")
    for side in ("left", "right")
    for a, b in (
        ("upper_arm", "lower_arm"),
        ("lower_arm", "hand"),
        ("upper_leg", "lower_leg"),
        ("lower_leg", "foot"),
    )
)
"""Bones whose direction is carried over: from joint, to joint."""


@dataclass(frozen=True, eq=False)
class _Axes:
    """How the source stands: `to_world` turns its axes to ours, `body` ours to its reference."""

    to_world: Vector
    body: Vector


def _axes(source: Skeleton, reference: Placement, joint_map: Mapping[str, str]) -> _Axes:
    """Find up, left and forward of the source from its hips, legs and head.

    World axes are taken as the nearest coordinate axes of the file; what heading is left at the
    reference pose is `body`'s.
    """
    at = {ours: reference.position_m[source.index(name)] for ours, name in joint_map.items()}
    hips = (at["left_upper_leg"] + at["right_upper_leg"]) / 2
    up = _nearest_axis(at["head"] - hips)
    across = at["left_upper_leg"] - at["right_upper_leg"]
    across = across - up * (across @ up)
    if np.linalg.norm(across) < 1e-6 or np.linalg.norm(at["head"] - hips) < 1e-6:
        raise MotionError("the source's hips and head stand in one place; choose another reference")
    left = unit(across)
    axis_across = _nearest_axis(across)
    to_source = quat_from_axes(-axis_across, up, -np.cross(axis_across, up))
    return _Axes(quat_conjugate(to_source), quat_from_axes(-left, up, -np.cross(left, up)))


def _nearest_axis(v: Vector) -> Vector:
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(v)))
    axis[k] = np.sign(v[k])
    return axis


def _leg_m(placement_m: Vector, source: Skeleton, joint_map: Mapping[str, str]) -> float:
    """Return the length of thigh and shin of the source, mean of both sides."""
    bones = [b for b in LIMB_BONES if b[0].endswith("_leg")]
    ends = [[source.index(joint_map[name]) for name in bone] for bone in bones]
    return float(sum(np.linalg.norm(placement_m[b] - placement_m[a]) for a, b in ends) / 2)


def _alignments(
    source: Skeleton,
    target: Skeleton,
    reference: Placement,
    axes: _Axes,
    joint_map: Mapping[str, str],
) -> Mapping[str, Vector]:
    """Return for every mapped joint the turn from our rest to its rest in the reference body."""
    to_body = quat_conjugate(axes.body)
    turns: dict[str, Vector] = {}
    for a, b in LIMB_BONES:
        ends = [reference.position_m[source.index(joint_map[name])] for name in (a, b)]
        along = ends[1] - ends[0]
        if np.linalg.norm(along) < 1e-6:
            raise MotionError(
                f"source joints {joint_map[a]!r} and {joint_map[b]!r} stand in one place; "
                "correct the joint map"
            )
        ours = unit(target.offsets_m[target.index(b)])
        turns[a] = quat_between(ours, rotate(to_body, unit(along)))
    for j, name in enumerate(target.names):
        follows = "hand" in name or "foot" in name or "toes" in name or target_finger(name)
        if name in joint_map and name not in turns:
            above = target.names[target.parents[j]] if follows else ""
            turns[name] = turns.get(above, IDENTITY)
    return turns


def target_finger(name: str) -> bool:
    """Tell whether a canonical joint is a finger's."""
    return name.rsplit("_", 1)[-1] in ("proximal", "middle", "distal")


def retarget(
    source: Clip,
    target: Skeleton | None = None,
    *,
    joint_map: Mapping[str, str] | None = None,
    reference_frame: int | None = None,
) -> Clip:
    """Return a clip for a skeleton with canonical joints, facing −z, y up, in metres.

    `target` defaults to the canonical skeleton. `joint_map` gives the source's joint for ours;
    found by name when None. `reference_frame` is a frame in which the person stands upright with
    straight limbs; None takes the file's own zero pose. The root is scaled with the length of the
    legs; joints without a source stay at rest.

    Raises:
        MotionError: joints are missing or stand in one place.
    """
    target = canonical_skeleton() if target is None else target
    names = _checked_map(source, target, joint_map)
    placement = forward(source.skeleton, source.root_m, source.orientation_wxyz)
    reference = _reference(source, placement, reference_frame)
    axes = _axes(source.skeleton, reference, names)
    alignments = _alignments(source.skeleton, target, reference, axes, names)

    world = np.empty((len(source.root_m), len(target.names), 4))
    for j, name in enumerate(target.names):
        if name not in names:
            world[:, j] = world[:, target.parents[j]] if j else IDENTITY
            continue
        i = source.skeleton.index(names[name])
        since_reference = quat_multiply(
            placement.orientation_wxyz[:, i], quat_conjugate(reference.orientation_wxyz[i])
        )
        ours = quat_multiply(axes.body, alignments[name])
        world[:, j] = quat_multiply(axes.to_world, quat_multiply(since_reference, ours))

    legs = [f"{side}_upper_leg" for side in ("left", "right")]
    source_legs = [source.skeleton.index(names[leg]) for leg in legs]
    scale = target.leg_m / _leg_m(reference.position_m, source.skeleton, names)
    middle = rotate(axes.to_world, placement.position_m[:, source_legs].mean(axis=1))
    below_root = target.rest_m[[target.index(leg) for leg in legs]].mean(axis=0)
    hips = world[:, target.index("hips")]
    root = scale * middle - rotate(hips, np.broadcast_to(below_root, middle.shape))
    local = local_of_world(target, continuous(world))
    return Clip(target, source.frame_s, root, local / np.linalg.norm(local, axis=-1, keepdims=True))


def _checked_map(
    source: Clip, target: Skeleton, joint_map: Mapping[str, str] | None
) -> Mapping[str, str]:
    names = match_joints(source.skeleton) if joint_map is None else joint_map
    missing = [name for name in (*NEEDED, "hips", "head") if name not in names]
    if missing:
        raise MotionError(f"joint map lacks {', '.join(missing)}; add the source's names for them")
    for name, theirs in names.items():
        target.index(name)
        source.skeleton.index(theirs)
    return names


def _reference(source: Clip, placement: Placement, frame: int | None) -> Placement:
    if frame is None:
        rest = source.skeleton.rest_m
        return Placement(rest, np.tile(IDENTITY, (len(rest), 1)))
    if not 0 <= frame < len(source.root_m):
        raise MotionError(f"reference frame {frame} of a clip with {len(source.root_m)} frames")
    return Placement(placement.position_m[frame], placement.orientation_wxyz[frame])


@dataclass(frozen=True, eq=False)
class RetargetingError:
    """How far a carried-over motion is from its source.

    `direction_deg` (frames, 8) angle between limb bones, order of `LIMB_BONES`. `reach_01`
    (frames, 4) distance between where left hand, right hand, left foot and right foot stand from
    the shoulder or hip, both bodies scaled to limbs of length one.
    """

    direction_deg: Vector
    reach_01: Vector


def retargeting_error(
    source: Clip,
    result: Clip,
    *,
    joint_map: Mapping[str, str] | None = None,
    reference_frame: int | None = None,
) -> RetargetingError:
    """Compare joint positions of a retargeted clip with those of its source."""
    names = _checked_map(source, result.skeleton, joint_map)
    theirs = forward(source.skeleton, source.root_m, source.orientation_wxyz)
    axes = _axes(source.skeleton, _reference(source, theirs, reference_frame), names)
    ours = forward(result.skeleton, result.root_m, result.orientation_wxyz).position_m

    def span(a: str, b: str) -> tuple[Vector, Vector]:
        i, j = (source.skeleton.index(names[x]) for x in (a, b))
        k, m = (result.skeleton.index(x) for x in (a, b))
        their_span = rotate(axes.to_world, theirs.position_m[:, j] - theirs.position_m[:, i])
        return their_span, ours[:, m] - ours[:, k]

    bones = [span(a, b) for a, b in LIMB_BONES]
    direction = np.stack([angle_deg(unit(x), unit(y)) for x, y in bones], axis=1)
    reach = []
    for i in range(0, len(bones), 2):
        chains = [bones[i][side] + bones[i + 1][side] for side in (0, 1)]
        lengths = [
            np.linalg.norm(bones[i][side], axis=1) + np.linalg.norm(bones[i + 1][side], axis=1)
            for side in (0, 1)
        ]
        ends = [chain / length[:, None] for chain, length in zip(chains, lengths, strict=True)]
        reach.append(np.linalg.norm(ends[0] - ends[1], axis=1))
    return RetargetingError(direction, np.stack(reach, axis=1)[:, [0, 2, 1, 3]])

"""Every step of a walk against everybody near: posed, culled, skinned, measured, in one kernel."""

from typing import NamedTuple

import numpy as np

from visavis.analysis.collisions.pair import measure_within
from visavis.analysis.collisions.skinned import (
    Bodies,
    any_boxes_meet,
    box_of_meetings,
    boxes_meet,
    group_boxes,
    joint_moves,
    posed_boxes,
    skin_vertices,
)
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.figures import Figures
from visavis.stimuli.contact.idle import N_JOINTS, place_person


class Measuring(NamedTuple):
    """How common volumes are measured."""

    reach_m: float
    """People whose place is farther than this from the box round the participant are left out."""
    cell_m: float
    refine_below_m3: float
    fine_columns: int
    """These three as in `Settings` of `visavis.analysis.collisions`."""
    only_near: bool
    """Whether nothing is measured: a 1 marks where boxes meet."""


@compiled
def volumes_of_walk(
    positions: Vector,
    worlds: Vector,
    crowd_t_s: Vector,
    own: Bodies,
    own_scale: float,
    people: Vector,
    figures: Figures,
    others: Bodies,
    how: Measuring,
    volumes: Vector,
) -> None:
    """Write the common volume (n, people) of a moving body with everybody, step by step.

    `positions` (n, 22, 3) and `worlds` (n, 22, 4) move `own`, the one surface of a participant;
    person p has surface `people[p, 15]` of `others`. Steps with a lost joint are NaN.
    """
    # Buffers once for all steps: nothing is allocated within the loops.
    most = 0
    for k in range(others.groups.shape[0]):
        most = max(most, others.vertex[k + 1] - others.vertex[k])
    theirs_m = np.empty((most, 3))
    own_m = np.empty((own.rest_m.shape[0], 3))
    own_moves, moves = np.empty((N_JOINTS, 3, 4)), np.empty((N_JOINTS, 3, 4))
    own_boxes, boxes = np.empty((N_JOINTS, 6)), np.empty((N_JOINTS, 6))
    own_tight, tight = np.empty((own.slices[0], 6)), np.empty((others.slices.max(), 6))
    own_whole, whole = np.empty(6), np.empty(6)
    common_box = np.empty((2, 3))
    root, local = np.empty((1, 3)), np.empty((1, N_JOINTS, 4))
    position, world = np.empty((1, N_JOINTS, 3)), np.empty((1, N_JOINTS, 4))
    for i in range(positions.shape[0]):
        if not np.isfinite(positions[i].sum() + worlds[i].sum()):
            volumes[i] = np.nan
            continue
        joint_moves(positions[i], worlds[i], own.joints_m[0], own_scale, own_moves)
        group_boxes(
            own.group,
            own.joint,
            own.centre_m,
            own.half_m,
            own.groups[0],
            own_moves,
            own_boxes,
            own_whole,
        )
        is_skinned = False
        for p in range(people.shape[0]):
            volumes[i, p] = 0.0
            # Test 1: distance on the floor, before the person is posed at all.
            dx = max(own_whole[0] - people[p, 0], 0.0, people[p, 0] - own_whole[3])
            dz = max(own_whole[2] - people[p, 1], 0.0, people[p, 1] - own_whole[5])
            if dx * dx + dz * dz > how.reach_m * how.reach_m:
                continue
            who = int(people[p, 15])
            place_person(people[p], crowd_t_s[i], figures, root, local, position, world)
            joint_moves(position[0], world[0], others.joints_m[who], 1.0, moves)
            q0, q1 = others.piece[who], others.piece[who + 1]
            n = others.groups[who]
            group_boxes(
                others.group[q0:q1],
                others.joint[q0:q1],
                others.centre_m[q0:q1],
                others.half_m[q0:q1],
                n,
                moves,
                boxes,
                whole,
            )
            # Test 2: boxes of the posed bodies, whole, then piece by piece.
            if not boxes_meet(own_whole, whole):
                continue
            if not any_boxes_meet(own_boxes, own.groups[0], boxes, n, whole):
                continue
            if how.only_near:
                volumes[i, p] = 1.0
                continue
            # The participant's surface is skinned at most once a step, for the first near person.
            if not is_skinned:
                skin_vertices(own.rest_m, own.bones, own.weights, own_moves, own_m)
                posed_boxes(own_m, own.corner, own.slice, own.slices[0], own_tight)
                is_skinned = True
            v0, v1 = others.vertex[who], others.vertex[who + 1]
            f0, f1 = others.face[who], others.face[who + 1]
            mesh_m = theirs_m[: v1 - v0]
            skin_vertices(
                others.rest_m[v0:v1], others.bones[v0:v1], others.weights[v0:v1], moves, mesh_m
            )
            # Test 3: boxes of the skinned slices, which also bound where to measure.
            n = others.slices[who]
            c0, c1 = others.corners[who], others.corners[who + 1]
            posed_boxes(mesh_m, others.corner[c0:c1], others.slice[c0:c1], n, tight)
            if not box_of_meetings(own_tight, own.slices[0], tight, n, whole, common_box):
                continue
            measured_pair = measure_within(
                own_m,
                own.faces,
                mesh_m,
                others.faces[f0:f1],
                common_box[0],
                common_box[1],
                how.cell_m,
                how.refine_below_m3,
                how.fine_columns,
            )
            volumes[i, p] = measured_pair[0]

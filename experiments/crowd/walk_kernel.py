"""Every step of a walk against everybody near: posed, culled, skinned, measured, in one kernel."""

from typing import NamedTuple

import numpy as np

from visavis.analysis.collisions.pair import longest_side, measure_shadows
from visavis.analysis.collisions.skinned import (
    Bodies,
    body_of,
    box_of_meetings,
    boxes_meet,
    comes_near,
    move_joints,
    room_for,
    shadow,
)
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.contact.figures import Figures
from visavis.stimuli.contact.idle import place_person, workspace


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
    # Buffers once for all steps; most vertices stay unposed at most of them.
    me, them = room_for(own), room_for(others)
    common_box = np.empty((2, 3))
    room = workspace()
    for i in range(positions.shape[0]):
        if not np.isfinite(positions[i].sum() + worlds[i].sum()):
            volumes[i] = np.nan
            continue
        move_joints(own, positions[i], worlds[i], own_scale, me)
        for p in range(people.shape[0]):
            volumes[i, p] = 0.0
            # Test 1: distance on the floor, before the person is posed at all; first of the whole
            # body, then of its slices.
            dx = max(me.whole[0] - people[p, 0], 0.0, people[p, 0] - me.whole[3])
            dz = max(me.whole[2] - people[p, 1], 0.0, people[p, 1] - me.whole[5])
            if dx * dx + dz * dz > how.reach_m * how.reach_m:
                continue
            if not comes_near(own, me, people[p, 0], people[p, 1], how.reach_m):
                continue
            other = body_of(others, int(people[p, 15]))
            place_person(people[p], crowd_t_s[i], figures, room)
            move_joints(other, room.position_m[0], room.world[0], 1.0, them)
            # Test 2: boxes of whole bodies, then of slices before and after they are posed.
            if not boxes_meet(me.whole, them.whole):
                continue
            if not box_of_meetings(own, me, other, them, how.only_near, common_box):
                continue
            if how.only_near:
                volumes[i, p] = 1.0
                continue
            low, high = common_box[0], common_box[1]
            axis = longest_side(low, high)
            mine_m, my_faces = shadow(own, me, axis, low, high)
            theirs_m, their_faces = shadow(other, them, axis, low, high)
            measured_pair = measure_shadows(
                mine_m,
                my_faces,
                theirs_m,
                their_faces,
                low,
                high,
                how.cell_m,
                how.refine_below_m3,
                how.fine_columns,
            )
            volumes[i, p] = measured_pair[0]

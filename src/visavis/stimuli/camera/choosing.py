"""Choose the best place of a camera graph for a shot: points of interest, scored, the best tested.

Everything but sight is cheap. Places are therefore ranked as if all of them saw the subject, and
rays are cast from the best downwards until none that follows could win.
"""

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.obstacles import NOBODY, is_near, sees
from visavis.stimuli.camera.shots import flow_cosine, shot_size_score, view_angle_deg

Ints = npt.NDArray[np.int64]
Floats32 = npt.NDArray[np.float32]

SIZE, DIRECT, INDIRECT, DISTANCE, ANGLE, FLOW = range(6)
"""The criteria by which a place is scored."""
SEEN = (0.4, 0.15, 0.25, 0.2)
"""Weights of seeing each point: head now, chest now, head soon, head later."""
NO_EDGE = -1
FAR_M = 10.0
"""Way along the graph over which the score of nearness falls to 1/e."""
MIN_FLAT_01 = 0.17
"""Least horizontal part of the distance to the subject: the camera looks down at most 80°."""


@compiled
def _stands_in(place: Vector, people: Vector, clear_m: float) -> bool:
    """Tell whether somebody (c, 7) comes nearer to a place than a margin."""
    for j in range(people.shape[0]):
        p = people[j]
        ax, ay, az = p[3] - p[0], p[4] - p[1], p[5] - p[2]
        sx, sy, sz = place[0] - p[0], place[1] - p[1], place[2] - p[2]
        length2 = ax * ax + ay * ay + az * az
        share = 0.0
        if length2 > 0.0:
            share = min(1.0, max(0.0, (ax * sx + ay * sy + az * sz) / length2))
        ox, oy, oz = sx - share * ax, sy - share * ay, sz - share * az
        limit = p[6] + clear_m
        if ox * ox + oy * oy + oz * oz < limit * limit:
            return True
    return False


@compiled
def is_free(
    place: Vector,
    people: Vector,
    clear_m: float,
    people_clear_m: float,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> bool:
    """Tell whether a camera keeps its distances from surfaces and people at a place."""
    return not (
        _stands_in(place, people, people_clear_m) or is_near(place, clear_m, boxes, links, corners)
    )


@compiled
def is_free_step(
    a: Vector,
    b: Vector,
    people: Vector,
    clear_m: float,
    people_clear_m: float,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> bool:
    """Tell whether a camera may go straight from a to b, which may lead away from people."""
    if not sees(a, b, NOBODY, boxes, links, corners) or is_near(b, clear_m, boxes, links, corners):
        return False
    return not _stands_in(b, people, people_clear_m) or _stands_in(a, people, people_clear_m)


@compiled
def points_of_interest(
    subject: Vector,
    wanted_m: float,
    reach_m: float,
    nodes: Vector,
    edges: Ints,
    component: Ints,
    only_component: int,
    edge_out: Ints,
    share_out: Vector,
) -> int:
    """Fill edges and shares along them where the subject is nearest or at the wanted distance.

    Only edges with an end within `reach_m`, and of one component unless that is −1.
    """
    n = 0
    near = np.empty(nodes.shape[0], np.bool_)
    for i in range(nodes.shape[0]):
        x, y, z = nodes[i, 0] - subject[0], nodes[i, 1] - subject[1], nodes[i, 2] - subject[2]
        near[i] = x * x + y * y + z * z <= reach_m * reach_m
    for e in range(edges.shape[0]):
        a, b = edges[e, 0], edges[e, 1]
        if not (near[a] or near[b]) or (only_component >= 0 and component[a] != only_component):
            continue
        dx, dy, dz = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1], nodes[b, 2] - nodes[a, 2]
        sx, sy, sz = subject[0] - nodes[a, 0], subject[1] - nodes[a, 1], subject[2] - nodes[a, 2]
        length2 = dx * dx + dy * dy + dz * dz
        # Foot of the perpendicular from the subject, as a share of the edge.
        foot = (dx * sx + dy * sy + dz * sz) / length2 if length2 > 0.0 else 0.0
        edge_out[n], share_out[n] = e, min(1.0, max(0.0, foot))
        n += 1
        if length2 == 0.0:
            continue
        ox, oy, oz = sx - foot * dx, sy - foot * dy, sz - foot * dz
        # Where the edge cuts the sphere of `wanted_m` about the subject: half a chord either side.
        left = wanted_m * wanted_m - ox * ox - oy * oy - oz * oz
        if left > 0.0:
            half = np.sqrt(left / length2)
            for t in (foot - half, foot + half):
                if 0.0 < t < 1.0:
                    edge_out[n], share_out[n] = e, t
                    n += 1
    return n


@compiled
def place_on(nodes: Vector, edges: Ints, edge: int, share: float) -> Vector:
    """Return the place (3,) at a share along an edge."""
    a, b = edges[edge, 0], edges[edge, 1]
    place = np.empty(3)
    for k in range(3):
        place[k] = nodes[a, k] + share * (nodes[b, k] - nodes[a, k])
    return place


@compiled
def _length_m(nodes: Vector, edges: Ints, edge: int) -> float:
    a, b = edges[edge, 0], edges[edge, 1]
    x, y, z = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1], nodes[b, 2] - nodes[a, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@compiled
def _score_without_sight(
    place: Vector,
    edge: int,
    share: float,
    subject: Vector,
    velocity: Vector,
    wanted_m: float,
    nodes: Vector,
    edges: Ints,
    around: Floats32,
    weights: Vector,
    current_edge: int,
    current_share: float,
    way_a: Floats32,
    way_b: Floats32,
    before: Vector,
) -> float:
    """Return the weighted parts of a place's score that need no ray; −1 where none can be filmed.

    `before` (3,) is the camera before a cut, NaN when there was none.
    """
    x, y, z = place[0] - subject[0], place[1] - subject[1], place[2] - subject[2]
    distance = np.sqrt(x * x + y * y + z * z)
    # Within half a metre, or nearly from above, nobody can be framed.
    if distance < 0.5 or np.hypot(x, z) < MIN_FLAT_01 * distance:
        return -1.0
    a, b = edges[edge, 0], edges[edge, 1]
    score = weights[SIZE] * shot_size_score(distance, wanted_m)
    score += weights[INDIRECT] * ((1.0 - share) * around[a] + share * around[b])
    if weights[DISTANCE] > 0.0 and current_edge >= 0:
        length = _length_m(nodes, edges, edge)
        if edge == current_edge:
            way = abs(share - current_share) * length
        else:
            # Shortest way along the graph: out by either end of the current edge, in by either end
            # here.
            own = _length_m(nodes, edges, current_edge)
            from_a, from_b = current_share * own, (1.0 - current_share) * own
            to_a = min(from_a + way_a[a], from_b + way_b[a])
            to_b = min(from_a + way_a[b], from_b + way_b[b])
            way = min(to_a + share * length, to_b + (1.0 - share) * length)
        score += weights[DISTANCE] * np.exp(-way / FAR_M)
    if weights[ANGLE] > 0.0:
        angle = 30.0 if np.isnan(before[0]) else view_angle_deg(subject, before, place)
        score += weights[ANGLE] * min(1.0, angle / 30.0)
    if weights[FLOW] > 0.0:
        flow = 1.0 if np.isnan(before[0]) else flow_cosine(subject, velocity, before, place)
        score += weights[FLOW] * (0.5 if np.isnan(flow) else (1.0 + flow) / 2.0)
    return float(score)


@compiled
def _seen_part(
    place: Vector,
    subject: Vector,
    min_share: float,
    people: Vector,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> float:
    """Return how well a place sees the subject (4 points, see `SEEN`), 0 to 1; 0 as soon as it
    cannot be more than what is needed.
    """
    part, possible = 0.0, 1.0
    for k in range(4):
        if sees(place, subject[k], people, boxes, links, corners):
            part += SEEN[k]
        else:
            # Stop early: what is left to see can no longer reach the share that is needed.
            possible -= SEEN[k]
            if possible <= min_share:
                return 0.0
    return part


@compiled
def move_to(
    subject: Vector,
    points: Vector,
    wanted_m: float,
    reach_m: float,
    camera: Vector,
    current_edge: int,
    current_share: float,
    step_m: float,
    max_tests: int,
    nodes: Vector,
    edges: Ints,
    component: Ints,
    around: Floats32,
    way_a: Floats32,
    way_b: Floats32,
    weights: Vector,
    people: Vector,
    clear_m: float,
    people_clear_m: float,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> tuple[int, float, float]:
    """Return edge, share and score of the best place to move to; edge −1 when there is none.

    Only places that the camera can reach in a straight line count. The best one is then shifted
    along its edge in fixed steps as long as the score rises.
    """
    # Candidates: up to three points an edge (nearest, and twice at the wanted distance), and where
    # the camera is now.
    edge_of = np.empty(3 * edges.shape[0] + 1, np.int64)
    share_of = np.empty(3 * edges.shape[0] + 1)
    n = points_of_interest(
        subject,
        wanted_m,
        reach_m,
        nodes,
        edges,
        component,
        component[edges[current_edge, 0]],
        edge_of,
        share_of,
    )
    edge_of[n], share_of[n] = current_edge, current_share
    n += 1
    # Without a cut there is no view before (NaN), so flow and angle count in full everywhere.
    velocity, before = np.zeros(3), np.full(3, np.nan)
    score = np.empty(n)
    for i in range(n):
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        score[i] = _score_without_sight(
            place,
            edge_of[i],
            share_of[i],
            subject,
            velocity,
            wanted_m,
            nodes,
            edges,
            around,
            weights,
            current_edge,
            current_share,
            way_a,
            way_b,
            before,
        )
    # Rays are the expensive part. The best unseen score goes first; the search ends as soon as even
    # a perfect view could not beat the best found, or after `max_tests` places.
    best, best_edge, best_share, best_sees = 0.0, NO_EDGE, 0.0, 0.0
    for _ in range(max_tests):
        i = int(np.argmax(score))
        if score[i] < 0.0 or score[i] + weights[DIRECT] <= best:
            break
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        min_share = (best - score[i]) / weights[DIRECT] if weights[DIRECT] > 0.0 else -1.0
        is_seen = _seen_part(place, points, min_share, people, boxes, links, corners)
        total = score[i] + weights[DIRECT] * is_seen
        score[i] = -2.0
        if (
            total > best
            and is_free(place, people, clear_m, people_clear_m, boxes, links, corners)
            and sees(camera, place, NOBODY, boxes, links, corners)
        ):
            best, best_edge, best_share, best_sees = total, edge_of[i], share_of[i], is_seen
    if best_edge == NO_EDGE:
        return NO_EDGE, 0.0, 0.0
    # Climb along the edge both ways in fixed steps, as long as the score rises and sight holds.
    length = _length_m(nodes, edges, best_edge)
    if length > 0.0:
        for side in (-1.0, 1.0):
            while True:
                share = best_share + side * step_m / length
                if share < 0.0 or share > 1.0:
                    break
                place = place_on(nodes, edges, best_edge, share)
                total = (
                    _score_without_sight(
                        place,
                        best_edge,
                        share,
                        subject,
                        velocity,
                        wanted_m,
                        nodes,
                        edges,
                        around,
                        weights,
                        current_edge,
                        current_share,
                        way_a,
                        way_b,
                        before,
                    )
                    + weights[DIRECT] * best_sees
                )
                if (
                    total <= best
                    or not is_free(place, people, clear_m, people_clear_m, boxes, links, corners)
                    or not sees(camera, place, NOBODY, boxes, links, corners)
                    or _seen_part(place, points, 0.0, people, boxes, links, corners) < best_sees
                ):
                    break
                best, best_share = total, share
    return best_edge, best_share, best


@compiled
def cut_to(
    subject: Vector,
    points: Vector,
    velocity: Vector,
    wanted_m: float,
    reach_m: float,
    before: Vector,
    min_angle_deg: float,
    nodes: Vector,
    edges: Ints,
    component: Ints,
    around: Floats32,
    way: Floats32,
    weights: Vector,
    people: Vector,
    clear_m: float,
    people_clear_m: float,
    boxes: Vector,
    links: Ints,
    corners: Vector,
) -> tuple[int, float, float, bool]:
    """Return edge, share and score to which to cut, and whether that keeps the angle.

    `points` (4, 3) are the subject's head and chest now, and the head twice later. Only places
    that see the head; edge −1 when none does. One that turns the view by less than `min_angle_deg`
    only where every other one does too.
    """
    edge_of = np.empty(3 * edges.shape[0], np.int64)
    share_of = np.empty(3 * edges.shape[0])
    n = points_of_interest(
        subject, wanted_m, reach_m, nodes, edges, component, -1, edge_of, share_of
    )
    score = np.empty(n)
    keeps = np.empty(n, np.bool_)
    for i in range(n):
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        score[i] = _score_without_sight(
            place,
            edge_of[i],
            share_of[i],
            subject,
            velocity,
            wanted_m,
            nodes,
            edges,
            around,
            weights,
            NO_EDGE,
            0.0,
            way,
            way,
            before,
        )
        keeps[i] = np.isnan(before[0]) or view_angle_deg(subject, before, place) >= min_angle_deg
    best, best_edge, best_share = 0.0, NO_EDGE, 0.0
    # First only places that turn the view enough (the 30° rule of cutting), then all others.
    for wants_angle in (True, False):
        rank = np.empty(n)
        for i in range(n):
            rank[i] = score[i] if keeps[i] == wants_angle else -2.0
        while n > 0:
            i = int(np.argmax(rank))
            # Scores fall from here on, so that no later place can win even with a perfect view.
            if rank[i] < 0.0 or rank[i] + weights[DIRECT] <= best:
                break
            rank[i] = -2.0
            place = place_on(nodes, edges, edge_of[i], share_of[i])
            if not sees(place, points[0], people, boxes, links, corners) or not is_free(
                place, people, clear_m, people_clear_m, boxes, links, corners
            ):
                continue
            total = score[i] + weights[DIRECT] * _seen_part(
                place, points, 0.0, people, boxes, links, corners
            )
            if total > best:
                best, best_edge, best_share = total, edge_of[i], share_of[i]
        if best_edge != NO_EDGE:
            return best_edge, best_share, best, wants_angle
    return NO_EDGE, 0.0, 0.0, False

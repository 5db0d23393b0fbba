"""Choose the best place of a camera graph for a shot: points of interest, scored, the best tested.

Everything but sight is cheap. Places are therefore ranked as if all of them saw the subject, and
rays are cast from the best downwards until none that follows could win.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.camera.graph import Network
from visavis.stimuli.camera.obstacles import NOBODY, is_near, sees
from visavis.stimuli.camera.shots import flow_cosine, shot_size_score, view_angle_deg

Ints = npt.NDArray[np.int64]
Floats32 = npt.NDArray[np.float32]

SIZE, DIRECT, INDIRECT, DISTANCE, ANGLE, FLOW = range(6)
"""The criteria by which a place is scored."""
AHEAD_OF_CUT_S = 1.0
"""For so long the subject should be seen after a cut."""
SEEN = (0.4, 0.15, 0.25, 0.2)
"""Weights of seeing each point: head now, chest now, head soon, head later."""
NO_EDGE = -1
FAR_M = 10.0
"""Way along the graph over which the score of nearness falls to 1/e."""
MIN_FLAT_01 = 0.17
"""Least horizontal part of the distance to the subject: the camera looks down at most 80°."""


class Subject(NamedTuple):
    """Who is filmed, and from how far.

    `centre` (3,) of the picture; `points` (4, 3) to be seen, in the order of `SEEN`. `wanted_m` is
    the distance that gives the shot its size; ways with an end within `reach_m` are looked at.
    """

    centre: Vector
    points: Vector
    wanted_m: float
    reach_m: float


class Clearance(NamedTuple):
    """What a camera keeps clear of: surfaces by `clear_m`, people (c, 7) by `people_clear_m`.

    `surfaces` are the arrays of `Obstacles`.
    """

    surfaces: tuple[Vector, Ints, Vector]
    people: Vector
    clear_m: float
    people_clear_m: float


class GraphPosition(NamedTuple):
    """Where a camera is on the graph: at a share of an edge, from whose ends every place (n,) is
    `from_a_m` and `from_b_m` along the graph.
    """

    edge: int
    share: float
    from_a_m: Floats32
    from_b_m: Floats32


class _Choice(NamedTuple):
    """A place on an edge, its score, and how well it sees the subject."""

    edge: int
    share: float
    score: float
    seen_01: float


@compiled
def _stands_in(place: Vector, people: Vector, clear_m: float) -> bool:
    """Tell whether somebody (c, 7) comes nearer to a place than a margin."""
    for j in range(people.shape[0]):
        p = people[j]
        ax, ay, az = p[3] - p[0], p[4] - p[1], p[5] - p[2]
        sx, sy, sz = place[0] - p[0], place[1] - p[1], place[2] - p[2]
        # The nearest point of the person's axis decides.
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
def is_free(place: Vector, clearance: Clearance) -> bool:
    """Tell whether a camera keeps its distances from surfaces and people at a place."""
    return not (
        _stands_in(place, clearance.people, clearance.people_clear_m)
        or is_near(place, clearance.clear_m, *clearance.surfaces)
    )


@compiled
def is_free_step(a: Vector, b: Vector, clearance: Clearance) -> bool:
    """Tell whether a camera may go straight from a to b, which may lead away from people."""
    surfaces, people, clear_m, people_clear_m = clearance
    if not sees(a, b, NOBODY, *surfaces) or is_near(b, clear_m, *surfaces):
        return False
    # Somebody may have walked into the camera: it must be free to leave.
    return not _stands_in(b, people, people_clear_m) or _stands_in(a, people, people_clear_m)


@compiled
def points_of_interest(
    subject: Vector,
    wanted_m: float,
    reach_m: float,
    network: Network,
    only_component: int,
    edge_out: Ints,
    share_out: Vector,
) -> int:
    """Fill edges and shares along them where the subject is nearest or at the wanted distance.

    Only edges with an end within `reach_m`, and of one component unless that is −1.
    """
    nodes, edges, component = network
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
def _length_m(network: Network, edge: int) -> float:
    nodes = network.nodes
    a, b = network.edges[edge, 0], network.edges[edge, 1]
    x, y, z = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1], nodes[b, 2] - nodes[a, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@compiled
def _view_score(
    place: Vector,
    edge: int,
    share: float,
    subject: Subject,
    network: Network,
    around: Floats32,
    weights: Vector,
) -> float:
    """Return the weighted size and indirect sight of a place; −1 where nobody can be filmed."""
    centre = subject.centre
    x, y, z = place[0] - centre[0], place[1] - centre[1], place[2] - centre[2]
    distance = np.sqrt(x * x + y * y + z * z)
    # Within half a metre, or nearly from above, nobody can be framed.
    if distance < 0.5 or np.hypot(x, z) < MIN_FLAT_01 * distance:
        return -1.0
    a, b = network.edges[edge, 0], network.edges[edge, 1]
    score = weights[SIZE] * shot_size_score(distance, subject.wanted_m)
    score += weights[INDIRECT] * ((1.0 - share) * around[a] + share * around[b])
    return float(score)


@compiled
def _way_m(edge: int, share: float, network: Network, current: GraphPosition) -> float:
    """Return the shortest way along the graph from where the camera is."""
    length = _length_m(network, edge)
    if edge == current.edge:
        return float(abs(share - current.share) * length)
    # Out by either end of the current edge, in by either end of this one.
    a, b = network.edges[edge, 0], network.edges[edge, 1]
    own = _length_m(network, current.edge)
    from_a, from_b = current.share * own, (1.0 - current.share) * own
    to_a = min(from_a + current.from_a_m[a], from_b + current.from_b_m[a])
    to_b = min(from_a + current.from_a_m[b], from_b + current.from_b_m[b])
    return float(min(to_a + share * length, to_b + (1.0 - share) * length))


@compiled
def _moving_score(
    place: Vector,
    edge: int,
    share: float,
    subject: Subject,
    current: GraphPosition,
    network: Network,
    around: Floats32,
    weights: Vector,
) -> float:
    """Return what a place to move to scores without sight; −1 where nobody can be filmed."""
    score = _view_score(place, edge, share, subject, network, around, weights)
    if score >= 0.0 and weights[DISTANCE] > 0.0:
        score += weights[DISTANCE] * np.exp(-_way_m(edge, share, network, current) / FAR_M)
    return float(score)


@compiled
def _cutting_score(
    place: Vector,
    edge: int,
    share: float,
    subject: Subject,
    velocity: Vector,
    before: Vector,
    network: Network,
    around: Floats32,
    weights: Vector,
) -> float:
    """Return what a place to cut to scores without sight; −1 where nobody can be filmed.

    `velocity` (3,) is the subject's, `before` (3,) the camera before the cut: NaN at the start,
    when any angle and flow will do.
    """
    score = _view_score(place, edge, share, subject, network, around, weights)
    if score < 0.0:
        return score
    # A cut that turns the view by less than 30° looks like a jump, and one that reverses the way
    # the subject crosses the picture confuses; more than 30° is no better.
    is_first = np.isnan(before[0])
    if weights[ANGLE] > 0.0:
        angle = 30.0 if is_first else view_angle_deg(subject.centre, before, place)
        score += weights[ANGLE] * min(1.0, angle / 30.0)
    if weights[FLOW] > 0.0:
        flow = 1.0 if is_first else flow_cosine(subject.centre, velocity, before, place)
        score += weights[FLOW] * (0.5 if np.isnan(flow) else (1.0 + flow) / 2.0)
    return float(score)


@compiled
def _seen_part(place: Vector, points: Vector, min_share: float, clearance: Clearance) -> float:
    """Return how well a place sees points (4, 3) of the subject, see `SEEN`, 0 to 1; 0 as soon as
    it cannot be more than what is needed.
    """
    part, possible = 0.0, 1.0
    for k in range(4):
        if sees(place, points[k], clearance.people, *clearance.surfaces):
            part += SEEN[k]
        else:
            # Stop early: what is left to see can no longer reach the share that is needed.
            possible -= SEEN[k]
            if possible <= min_share:
                return 0.0
    return part


@compiled
def _may_go(camera: Vector, place: Vector, clearance: Clearance) -> bool:
    """Tell whether the camera can stand at a place and go there in a straight line.

    People on the way do not count: they will have walked on, and `is_free_step` watches them.
    """
    return is_free(place, clearance) and sees(camera, place, NOBODY, *clearance.surfaces)


@compiled
def _climb(
    best: _Choice,
    subject: Subject,
    camera: Vector,
    current: GraphPosition,
    step_m: float,
    network: Network,
    around: Floats32,
    weights: Vector,
    clearance: Clearance,
) -> _Choice:
    """Return a place on the same edge, in fixed steps either way as long as the score rises."""
    length = _length_m(network, best.edge)
    if length == 0.0:
        return best
    for side in (-1.0, 1.0):
        while True:
            share = best.share + side * step_m / length
            if share < 0.0 or share > 1.0:
                break
            place = place_on(network.nodes, network.edges, best.edge, share)
            # Sight is taken to be as good as before and tested only where the score rises.
            score = _moving_score(
                place, best.edge, share, subject, current, network, around, weights
            )
            score += weights[DIRECT] * best.seen_01
            if (
                score <= best.score
                or not _may_go(camera, place, clearance)
                or _seen_part(place, subject.points, 0.0, clearance) < best.seen_01
            ):
                break
            best = _Choice(best.edge, share, score, best.seen_01)
    return best


@compiled
def move_to(
    subject: Subject,
    camera: Vector,
    current: GraphPosition,
    step_m: float,
    max_tests: int,
    network: Network,
    around: Floats32,
    weights: Vector,
    clearance: Clearance,
) -> tuple[int, float, float]:
    """Return edge, share and score of the best place to move to; edge −1 when there is none.

    Only places that the camera (3,) can reach in a straight line count. The best one is then
    shifted along its edge in fixed steps as long as the score rises.
    """
    # Candidates: up to three points an edge (nearest, and twice at the wanted distance), and where
    # the camera is now. Other parts of the graph cannot be reached without a cut.
    nodes, edges, component = network
    edge_of = np.empty(3 * edges.shape[0] + 1, np.int64)
    share_of = np.empty(3 * edges.shape[0] + 1)
    part = component[edges[current.edge, 0]]
    n = points_of_interest(
        subject.centre, subject.wanted_m, subject.reach_m, network, part, edge_of, share_of
    )
    edge_of[n], share_of[n] = current.edge, current.share
    n += 1
    score = np.empty(n)
    for i in range(n):
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        score[i] = _moving_score(
            place, edge_of[i], share_of[i], subject, current, network, around, weights
        )
    # Rays are the expensive part. The best unseen score goes first; the search ends as soon as even
    # a perfect view could not beat the best found, or after `max_tests` places.
    best = _Choice(NO_EDGE, 0.0, 0.0, 0.0)
    for _ in range(max_tests):
        i = int(np.argmax(score))
        if score[i] < 0.0 or score[i] + weights[DIRECT] <= best.score:
            break
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        min_share = (best.score - score[i]) / weights[DIRECT] if weights[DIRECT] > 0.0 else -1.0
        seen_01 = _seen_part(place, subject.points, min_share, clearance)
        total = score[i] + weights[DIRECT] * seen_01
        score[i] = -2.0
        if total > best.score and _may_go(camera, place, clearance):
            best = _Choice(edge_of[i], share_of[i], total, seen_01)
    if best.edge == NO_EDGE:
        return NO_EDGE, 0.0, 0.0
    # The points of interest know nothing of sight or of the way; a little aside may be better.
    best = _climb(best, subject, camera, current, step_m, network, around, weights, clearance)
    return best.edge, best.share, best.score


@compiled
def _sees_soon(place: Vector, subject: Subject, velocity: Vector, clearance: Clearance) -> bool:
    """Tell whether the head will be seen from a place in half of `AHEAD_OF_CUT_S`, and then."""
    for share in (0.5, 1.0):
        head = subject.points[0] + share * AHEAD_OF_CUT_S * velocity
        if not sees(place, head, clearance.people, *clearance.surfaces):
            return False
    return True


@compiled
def cut_to(
    subject: Subject,
    velocity: Vector,
    before: Vector,
    min_angle_deg: float,
    network: Network,
    around: Floats32,
    weights: Vector,
    clearance: Clearance,
) -> tuple[int, float, float, bool]:
    """Return edge, share and score to which to cut, and whether that keeps the angle.

    `velocity` (3,) is the subject's, `before` (3,) the camera before the cut. Only places that see
    the head; edge −1 when none does. One from which the head will be hidden within `AHEAD_OF_CUT_S`
    only where there is no other, and then one that turns the view by less than `min_angle_deg` only
    where every other one does too.
    """
    nodes, edges, _ = network
    edge_of = np.empty(3 * edges.shape[0], np.int64)
    share_of = np.empty(3 * edges.shape[0])
    n = points_of_interest(
        subject.centre, subject.wanted_m, subject.reach_m, network, -1, edge_of, share_of
    )
    score = np.empty(n)
    keeps = np.empty(n, np.bool_)
    for i in range(n):
        place = place_on(nodes, edges, edge_of[i], share_of[i])
        score[i] = _cutting_score(
            place, edge_of[i], share_of[i], subject, velocity, before, network, around, weights
        )
        keeps[i] = (
            np.isnan(before[0]) or view_angle_deg(subject.centre, before, place) >= min_angle_deg
        )
    best, best_edge, best_share = 0.0, NO_EDGE, 0.0
    # First only places that will see the head and turn the view enough (the 30° rule of cutting).
    for attempt in range(4):
        wants_ahead, wants_angle = attempt < 2, attempt % 2 == 0
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
            # A cut to somewhere from which the face is hidden would look like a mistake.
            sees_head = sees(place, subject.points[0], clearance.people, *clearance.surfaces)
            if not sees_head or not is_free(place, clearance):
                continue
            if wants_ahead and not _sees_soon(place, subject, velocity, clearance):
                continue
            seen_01 = _seen_part(place, subject.points, 0.0, clearance)
            total = score[i] + weights[DIRECT] * seen_01
            if total > best:
                best, best_edge, best_share = total, edge_of[i], share_of[i]
        if best_edge != NO_EDGE:
            return best_edge, best_share, best, wants_angle
    return NO_EDGE, 0.0, 0.0, False

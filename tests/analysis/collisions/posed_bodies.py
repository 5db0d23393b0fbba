"""Generate people of capsules in random poses, for the collision benchmark and its tests.

Each part is a closed surface of its own and parts overlap at the joints, so a body overlaps
itself as skinned people do.
"""

import numpy as np

from visavis.analysis.collisions import ClosedMesh, capsule, union
from visavis.lab.geometry import Vector

# part, parent joint, start offset from parent, rest direction, length, radius
_PARTS = (
    ("pelvis", None, (-0.09, 0.95, 0.0), (1, 0, 0), 0.18, 0.115),
    ("belly", None, (0.0, 1.02, 0.0), (0, 1, 0), 0.18, 0.13),
    ("chest", None, (-0.08, 1.28, 0.0), (1, 0, 0), 0.16, 0.13),
    ("neck", None, (0.0, 1.38, 0.0), (0, 1, 0), 0.14, 0.055),
    ("head", None, (0.0, 1.56, 0.0), (0, 1, 0), 0.08, 0.10),
    ("upper_arm_l", None, (-0.19, 1.36, 0.0), (0, -1, 0), 0.28, 0.050),
    ("forearm_l", "upper_arm_l", None, (0, -1, 0), 0.25, 0.042),
    ("hand_l", "forearm_l", None, (0, -1, 0), 0.12, 0.036),
    ("upper_arm_r", None, (0.19, 1.36, 0.0), (0, -1, 0), 0.28, 0.050),
    ("forearm_r", "upper_arm_r", None, (0, -1, 0), 0.25, 0.042),
    ("hand_r", "forearm_r", None, (0, -1, 0), 0.12, 0.036),
    ("thigh_l", None, (-0.09, 0.92, 0.0), (0, -1, 0), 0.42, 0.078),
    ("shin_l", "thigh_l", None, (0, -1, 0), 0.40, 0.055),
    ("foot_l", "shin_l", None, (0, 0, -1), 0.16, 0.042),
    ("thigh_r", None, (0.09, 0.92, 0.0), (0, -1, 0), 0.42, 0.078),
    ("shin_r", "thigh_r", None, (0, -1, 0), 0.40, 0.055),
    ("foot_r", "shin_r", None, (0, 0, -1), 0.16, 0.042),
)
_SWING = {"upper_arm": 0.45, "forearm": 0.5, "hand": 0.2, "thigh": 0.25, "shin": 0.2, "foot": 0.1}


def posed_person(
    edge_m: float,
    position_m: Vector,
    yaw_rad: float,
    rng: np.random.Generator,
    *,
    size: float = 1.0,
) -> ClosedMesh:
    """Return a standing person in a random pose, feet near `position_m`, edges about `edge_m`.

    The number of triangles depends on `edge_m` and `size` alone.
    """
    ends: dict[str, Vector] = {}
    meshes = []
    for name, parent, offset, rest, length, radius in _PARTS:
        start = ends[parent] if parent else np.array(offset, float)
        limb = name.rsplit("_", 1)[0]
        direction = np.array(rest, float)
        if limb in _SWING:
            direction = direction + rng.normal(0, _SWING[limb], 3)
        direction /= np.linalg.norm(direction)
        end = start + length * direction
        ends[name] = end
        segments = max(8, round(2 * np.pi * radius / edge_m))
        meshes.append(
            capsule(
                start * size,
                end * size,
                radius * size,
                segments=segments,
                rings=max(3, round(np.pi / 2 * radius / edge_m)),
                along=max(1, round(length / edge_m)),
            )
        )
    body = union(meshes)
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return ClosedMesh(body.vertices_m @ turn.T + position_m, body.faces)


def posed_pair(edge_m: float, rng: np.random.Generator) -> tuple[ClosedMesh, ClosedMesh]:
    """Return two people whose boxes overlap, at a distance from grazing to deep contact."""
    while True:
        bearing, distance = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.62)
        away = distance * np.array([np.sin(bearing), 0.0, np.cos(bearing)])
        a = posed_person(edge_m, np.zeros(3), rng.uniform(0, 2 * np.pi), rng)
        b = posed_person(edge_m, away, rng.uniform(0, 2 * np.pi), rng)
        low = np.maximum(a.vertices_m.min(0), b.vertices_m.min(0))
        high = np.minimum(a.vertices_m.max(0), b.vertices_m.max(0))
        if (low < high).all():
            return a, b

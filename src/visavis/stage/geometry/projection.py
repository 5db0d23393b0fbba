"""Matrices of cameras and lamps; numbers (4, 4) that act on column vectors."""

import numpy as np

from visavis.lab.geometry import Pose, Vector, unit
from visavis.stimuli.picture import Camera


def projection(camera: Camera) -> Vector:
    """Return the perspective of a frustum given by tangents."""
    near, far = camera.near_m, camera.far_m
    width, height = camera.right - camera.left, camera.top - camera.bottom
    return np.array(
        [
            [2 / width, 0, (camera.right + camera.left) / width, 0],
            [0, 2 / height, (camera.top + camera.bottom) / height, 0],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )


def axes(pose: Pose) -> Vector:
    """Return the axes of a pose as columns (3, 3)."""
    w, x, y, z = np.asarray(pose.orientation_wxyz).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def world_from(pose: Pose) -> Vector:
    """Return the matrix from a pose's own frame to world."""
    matrix = np.eye(4)
    matrix[:3, :3] = axes(pose)
    matrix[:3, 3] = pose.position_m
    return matrix


def view(pose: Pose) -> Vector:
    """Return the matrix from world to a pose's own frame."""
    matrix = np.eye(4)
    turn = axes(pose).T
    matrix[:3, :3] = turn
    matrix[:3, 3] = -turn @ pose.position_m
    return matrix


def looking(place_m: Vector, direction: Vector) -> Vector:
    """Return the matrix from world to a frame at `place_m` that looks along `direction`."""
    forward = unit(np.asarray(direction, np.float64))
    up = np.array([0.0, 0.0, -1.0]) if abs(forward[1]) > 0.9 else np.array([0.0, 1.0, 0.0])
    right = unit(np.cross(forward, up))
    matrix = np.eye(4)
    matrix[0, :3], matrix[1, :3], matrix[2, :3] = right, np.cross(right, forward), -forward
    matrix[:3, 3] = -matrix[:3, :3] @ place_m
    return matrix


def for_gl(matrix: Vector) -> bytes:
    """Return a matrix as the graphics card reads it: columns of float32."""
    return np.ascontiguousarray(matrix.T, np.float32).tobytes()

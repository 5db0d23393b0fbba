"""Write messages as Pupil Capture publishes them, from its documented format.

Sources: Pupil Labs' developer notes on the network API and the gaze datum format, and the
calling conventions of its public `pupil-helpers` and HMD clients. Frame of 3-D fields: the scene
camera, x right, y down, z forward, millimetres; eye 0 is the right eye.
"""

import struct
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgpack
import numpy as np
import numpy.typing as npt

from visavis.lab.compiled import compiled

Floats = npt.NDArray[np.float64]

BINOCULAR_TOPIC = b"gaze.3d.01."
MONOCULAR_TOPICS = (b"gaze.3d.0.", b"gaze.3d.1.")

GAZE_VALUES = (
    "timestamp",
    "confidence",
    "norm_x",
    "norm_y",
    "point_x",
    "point_y",
    "point_z",
    *(f"normal{eye}_{axis}" for eye in (0, 1) for axis in "xyz"),
    *(f"confidence{eye}" for eye in (0, 1)),
    *(f"diameter{eye}_mm" for eye in (0, 1)),
    *(f"diameter{eye}_px" for eye in (0, 1)),
)
"""Columns of the matrix that `GazeTemplate.pack` takes."""

COLUMN = {name: i for i, name in enumerate(GAZE_VALUES)}


class DatumPattern(NamedTuple):
    """The bytes of a datum, and where in them its numbers stand."""

    bytes: npt.NDArray[np.uint8]
    columns: npt.NDArray[np.int64]
    """(numbers,) the column of `GAZE_VALUES` of each number."""
    places: npt.NDArray[np.int64]
    """(numbers,) where its eight bytes begin."""


class GazeTemplate:
    """Pack gaze data of one topic: the constant bytes once, only the numbers per datum."""

    def __init__(self, topic: bytes, eye_centers_mm: Mapping[int, tuple[float, ...]]) -> None:
        self.topic = topic
        marks = {name: 1e300 * (1 + i / 64) for i, name in enumerate(GAZE_VALUES)}
        datum_bytes: bytes = msgpack.packb(_datum(topic, eye_centers_mm, marks))
        columns: list[int] = []
        places: list[int] = []
        for name, mark in marks.items():
            pattern = struct.pack(">d", mark)
            at = datum_bytes.find(pattern)
            while at >= 0:
                columns.append(COLUMN[name])
                places.append(at)
                at = datum_bytes.find(pattern, at + 8)
        self.pattern = DatumPattern(
            np.frombuffer(datum_bytes, np.uint8), np.array(columns), np.array(places)
        )

    def pack(self, values: Floats) -> list[tuple[bytes, bytes]]:
        """Return [topic, datum] messages for a matrix (n, len(GAZE_VALUES))."""
        datums = np.empty((values.shape[0], self.pattern.bytes.size), np.uint8)
        write_datums(values, self.pattern, datums)
        return self.messages(datums)

    def messages(self, datums: npt.NDArray[np.uint8]) -> list[tuple[bytes, bytes]]:
        """Return [topic, datum] messages for the bytes that `write_datums` wrote."""
        size = self.pattern.bytes.size
        data = datums.tobytes()
        if len(data) == size:
            return [(self.topic, data)]
        return [(self.topic, data[at : at + size]) for at in range(0, len(data), size)]


@compiled
def write_datums(
    values: Floats,
    pattern: DatumPattern,
    datums: npt.NDArray[np.uint8],
) -> None:
    """Write one datum per row of values: the pattern, and every number big-endian in its place."""
    columns, places = pattern.columns, pattern.places
    for i in range(values.shape[0]):
        little = values[i].view(np.uint8)
        for k in range(pattern.bytes.shape[0]):
            datums[i, k] = pattern.bytes[k]
        for j in range(columns.shape[0]):
            first = 8 * columns[j]
            for k in range(8):
                datums[i, places[j] + k] = little[first + 7 - k]


def pack_notification(subject: str, **fields: Any) -> tuple[bytes, bytes]:
    """Return a notification's two frames."""
    payload: bytes = msgpack.packb({"subject": subject, "topic": f"notify.{subject}", **fields})
    return f"notify.{subject}".encode(), payload


def _datum(
    topic: bytes, eye_centers_mm: Mapping[int, tuple[float, ...]], v: Mapping[str, float]
) -> dict[str, Any]:
    eyes = tuple(sorted(eye_centers_mm))
    normals = {eye: [v[f"normal{eye}_{axis}"] for axis in "xyz"] for eye in eyes}
    datum: dict[str, Any] = {"topic": topic.decode()}
    if len(eyes) > 1:
        datum["eye_centers_3d"] = {str(eye): list(eye_centers_mm[eye]) for eye in eyes}
        datum["gaze_normals_3d"] = {str(eye): normals[eye] for eye in eyes}
    else:
        datum["eye_center_3d"] = list(eye_centers_mm[eyes[0]])
        datum["gaze_normal_3d"] = normals[eyes[0]]
    datum["gaze_point_3d"] = [v["point_x"], v["point_y"], v["point_z"]]
    datum["norm_pos"] = [v["norm_x"], v["norm_y"]]
    datum["confidence"] = v["confidence"]
    datum["timestamp"] = v["timestamp"]
    datum["base_data"] = [_pupil(eye, v) for eye in eyes]
    return datum


def _pupil(eye: int, v: Mapping[str, float]) -> dict[str, Any]:
    """Return one eye camera's datum; geometry in that camera's frame is a fixed example."""
    return {
        "id": eye,
        "topic": f"pupil.{eye}.3d",
        "method": "pye3d 0.3.0 real-time",
        "norm_pos": [0.5, 0.5],
        "diameter": v[f"diameter{eye}_px"],
        "confidence": v[f"confidence{eye}"],
        "timestamp": v["timestamp"],
        "sphere": {"center": [1.5, 2.0, 40.0], "radius": 10.392},
        "projected_sphere": {"center": [96.0, 96.0], "axes": [150.0, 150.0], "angle": 0.0},
        "circle_3d": {"center": [1.5, 2.0, 30.0], "normal": [0.0, 0.0, -1.0], "radius": 1.5},
        "diameter_3d": v[f"diameter{eye}_mm"],
        "ellipse": {"center": [96.0, 96.0], "axes": [30.0, 32.0], "angle": 10.0},
        "location": [96.0, 96.0],
        "model_confidence": 1.0,
        "theta": 1.5,
        "phi": -1.5,
    }

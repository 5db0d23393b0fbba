"""What a frame showed, as rows of recorded streams."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from visavis.lab.frame import EyeView, FrameInfo
from visavis.lab.geometry import Pose, Vector
from visavis.lab.schema import Field, SampleBatch, StreamSchema
from visavis.stage.renderer import Quality, Shadows
from visavis.stimuli.picture import Picture

OUT_OF_VIEW, ABSENT = -1, -2
MAX_EYES = 2
SHADOWS: tuple[Shadows, ...] = ("maps", "blobs", "none", "area")

DRAWN_VIEWS = StreamSchema(
    name="drawn_views",
    nominal_rate_hz=0.0,
    fields=(
        Field("eyes", "u1", "", description="how many pictures a frame has, left eye first"),
        Field("offset_m", "f8", "m", "head", (MAX_EYES, 3), "from the head's pose to each eye"),
        Field("orientation_wxyz", "f8", "1", "head", (MAX_EYES, 4), "of each eye's view"),
        Field("tangents", "f8", "1", "", (MAX_EYES, 4), "bounds: left, right, bottom, top"),
        Field("size_px", "i4", "", "", (2,), "width and height of a picture"),
        Field("samples", "u1", "", description="per pixel; 0 without smoothing"),
        Field("shadows", "u1", "", description="index into: maps, blobs, none, area"),
        Field("shadow_map_px", "u4", "", description="side of a shadow map"),
        Field("shadow_softness_m", "f8", "m", description="of shadows' edges"),
        Field("fast", "?", "", description="light computed at vertices"),
    ),
)
"""How pictures are made from a frame on; a row whenever drawing begins, and whenever the eyes look
another way: through a screen they do from every place of the head."""

DRAWN_GPU = StreamSchema(
    name="drawn_gpu",
    nominal_rate_hz=0.0,
    fields=(
        Field("frame", "i8", "", description="index of the frame, as in FrameInfo"),
        Field("gpu_ms", "f4", "ms", description="the card's own work on the frame's pictures"),
    ),
)
"""What frames cost the card, known some frames later; no row when the cost is unknown."""


def drawn_schema(people_count: int, rate_hz: float) -> StreamSchema:
    """Return the stream of drawn frames for pictures of at most so many people."""
    n = max(people_count, 1)
    return StreamSchema(
        name="drawn",
        nominal_rate_hz=rate_hz,
        fields=(
            Field("frame", "i8", "", description="index of the frame, as in FrameInfo"),
            Field("t_scene_ns", "i8", "ns", description="session time of the scene drawn"),
            Field("predicted_display_ns", "i8", "ns", description="when its light was to leave"),
            Field("t_drawn_ns", "i8", "ns", description="images ready to be handed over"),
            Field("skipped", "u4", "", description="frames the display went on without, before"),
            Field("head_position_m", "f8", "m", "world", (3,), "pose it was drawn from"),
            Field("head_orientation_wxyz", "f8", "1", "world", (4,), "pose it was drawn from"),
            Field("picture_crc32", "u4", "", description="of every pose, place, fade and panel"),
            Field("brightness_01", "f4", "1", description="fade: 0 black"),
            Field("level", "i1", "", "", (n,), "detail per person; -1 out of view, -2 not there"),
            Field("drawn", "?", "", description="false: the graphics driver failed"),
        ),
    )


@dataclass(frozen=True, eq=False)
class DrawnFrame:
    """One row: all that a re-draw needs in addition to the scene."""

    frame: FrameInfo
    head: Pose
    level: npt.NDArray[np.int64]
    picture_crc32: int
    brightness_01: float
    t_scene_ns: int
    t_drawn_ns: int


def picture_crc32(picture: Picture) -> int:
    """Return a checksum of everything in a picture that may change from frame to frame."""
    people = picture.people
    crc = 0
    for array in people.parts_moved:
        crc = zlib.crc32(_bytes(array), crc)
    for thing in picture.moving:
        crc = zlib.crc32(thing.prop.name.encode(), crc)
        crc = zlib.crc32(_bytes(thing.pose.position_m), crc)
        crc = zlib.crc32(_bytes(thing.pose.orientation_wxyz), crc)
    for panel in picture.panels:
        usual = (panel.text, panel.choices, panel.size_m, panel.highlighted, panel.chosen)
        content = (*usual, *panel.additions)
        crc = zlib.crc32(repr(content).encode(), crc)
        crc = zlib.crc32(_bytes(panel.pose.position_m), crc)
    for sheet in picture.sheets:
        crc = zlib.crc32(repr((sheet.size_m, zlib.crc32(sheet.pixels.tobytes()))).encode(), crc)
        crc = zlib.crc32(_bytes(sheet.pose.position_m), crc)
    if picture.surround is not None:
        crc = zlib.crc32(repr(picture.surround.crc32).encode(), crc)
        crc = zlib.crc32(_bytes(picture.surround.orientation_wxyz), crc)
    if picture.veil is not None:
        veil, place = picture.veil, picture.veil.place
        crc = zlib.crc32(repr((veil.window, veil.distance_m, veil.colour_srgb)).encode(), crc)
        crc = zlib.crc32(_bytes(np.concatenate([place.eye_m, place.direction])), crc)
    if picture.mark_m is not None:
        crc = zlib.crc32(_bytes(np.asarray(picture.mark_m)), crc)
    names = ",".join(person.name for person in picture.cast)
    crc = zlib.crc32(f"{picture.room.name};{names};{picture.brightness_01!r}".encode(), crc)
    return crc


def truth_row(
    schema: StreamSchema, seq: int, shot: DrawnFrame, *, is_failed: bool = False
) -> SampleBatch:
    """Return the row of a frame."""
    values = np.zeros(1, schema.dtype)
    row = values[0]
    row["frame"] = shot.frame.index
    row["t_scene_ns"] = shot.t_scene_ns
    row["predicted_display_ns"] = shot.frame.predicted_display_ns
    row["t_drawn_ns"] = shot.t_drawn_ns
    row["skipped"] = shot.frame.dropped
    row["head_position_m"] = shot.head.position_m
    row["head_orientation_wxyz"] = shot.head.orientation_wxyz
    row["picture_crc32"] = shot.picture_crc32
    row["brightness_01"] = shot.brightness_01
    levels = row["level"]
    levels[:] = ABSENT
    n = min(len(levels), len(shot.level))
    levels[:n] = shot.level[:n]
    row["drawn"] = not is_failed
    return SampleBatch(
        schema,
        np.array([seq], np.int64),
        np.array([shot.frame.predicted_display_ns], np.int64),
        np.array([shot.t_drawn_ns], np.int64),
        values,
    )


def views_row(
    seq: int, views: Sequence[EyeView], size_px: tuple[int, int], quality: Quality, t_ns: int
) -> SampleBatch:
    """Return the row that describes how pictures are made from now on."""
    values = np.zeros(1, DRAWN_VIEWS.dtype)
    row = values[0]
    row["eyes"], row["size_px"] = len(views), size_px
    for i, view in enumerate(views[:MAX_EYES]):
        row["offset_m"][i], row["orientation_wxyz"][i] = view.offset_m, view.orientation_wxyz
        row["tangents"][i] = (
            view.tangent_left,
            view.tangent_right,
            view.tangent_bottom,
            view.tangent_top,
        )
    row["samples"], row["fast"] = quality.samples, quality.fast
    row["shadows"] = SHADOWS.index(quality.shadows)
    row["shadow_map_px"] = quality.shadow_map_px
    row["shadow_softness_m"] = quality.shadow_softness_m
    stamp = np.array([t_ns], np.int64)
    return SampleBatch(DRAWN_VIEWS, np.array([seq], np.int64), stamp, stamp, values)


def gpu_rows(seq: int, gpu_times: Sequence[tuple[FrameInfo, float]], t_ns: int) -> SampleBatch:
    """Return a row for every frame whose cost (ms) became known at `t_ns`."""
    values = np.array([(frame.index, gpu_ms) for frame, gpu_ms in gpu_times], DRAWN_GPU.dtype)
    shown_ns = np.array([frame.predicted_display_ns for frame, _ in gpu_times], np.int64)
    told_ns = np.full(len(gpu_times), t_ns, np.int64)
    return SampleBatch(DRAWN_GPU, seq + np.arange(len(gpu_times)), shown_ns, told_ns, values)


def read_views(row: np.void) -> tuple[tuple[EyeView, ...], tuple[int, int], Quality]:
    """Return the eyes, the pictures' size and the quality of a row of `DRAWN_VIEWS`."""
    views = tuple(
        EyeView(
            (float(x), float(y), float(z)),
            (float(w), float(i), float(j), float(k)),
            *(float(t) for t in row["tangents"][eye]),
        )
        for eye, ((x, y, z), (w, i, j, k)) in enumerate(
            zip(row["offset_m"], row["orientation_wxyz"], strict=True)
        )
        if eye < int(row["eyes"])
    )
    quality = Quality(
        samples=int(row["samples"]),
        shadows=SHADOWS[int(row["shadows"])],
        shadow_map_px=int(row["shadow_map_px"]),
        shadow_softness_m=float(row["shadow_softness_m"]),
        fast=bool(row["fast"]),
    )
    return views, (int(row["size_px"][0]), int(row["size_px"][1])), quality


def read_row(row: np.void) -> tuple[Pose, npt.NDArray[np.int64]]:
    """Return the head's pose and the levels (n,) of everyone who was there."""
    level = np.asarray(row["level"], np.int64)
    head = Pose(
        np.asarray(row["head_position_m"], np.float64),
        np.asarray(row["head_orientation_wxyz"], np.float64),
    )
    return head, level[level != ABSENT]


def _bytes(vector: Vector) -> bytes:
    return np.ascontiguousarray(vector, np.float64).tobytes()

"""Everything that is drawn in one frame, as data any renderer can draw.

Static things are shared objects: while `Picture.room` and `Picture.cast` are the same objects,
a renderer rebuilds nothing.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Pose, Vector
from visavis.stimuli.characters.character import Character, Material
from visavis.stimuli.gaze_window import Veil


@dataclass(frozen=True, eq=False)
class StaticMesh:
    """Rigid geometry: `vertices_m`, `normals` (v, 3), `colour_srgb` (v, 3) uint8, `uv` (v, 2) or
    None, `triangles` (t, 3) counter-clockwise from outside.
    """

    vertices_m: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    colour_srgb: npt.NDArray[np.uint8]
    triangles: npt.NDArray[np.int32]
    uv: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Block:
    """The shape of a thing that hides light from the floor below it: an upright box or, if `round`,
    a cylinder.

    Its underside's middle (x, y, z) is at `at_m`, above a level floor at `floor_m`; it reaches
    `half_x_m` and `half_z_m` from there along its own axes, turned by `yaw_deg`, and is `high_m`
    high. A cylinder stands on its floor and has the radius `half_x_m`.
    """

    at_m: tuple[float, float, float]
    half_x_m: float
    half_z_m: float
    high_m: float
    floor_m: float = 0.0
    yaw_deg: float = 0.0
    round: bool = False


@dataclass(frozen=True, eq=False)
class Prop:
    """A thing in a room; `emission_01` is how much of its colour it gives off by itself, `blocks`
    what of it darkens the floor where it stands.
    """

    name: str
    mesh: StaticMesh
    material: Material
    emission_01: float = 0.0
    casts_shadow: bool = True
    blocks: tuple[Block, ...] = ()


@dataclass(frozen=True, eq=False)
class Light:
    """A lamp. A "sun" shines along `direction` everywhere, a "spot" from `position_m` within
    `half_angle_deg`, a "point" all round. `intensity` is linear RGB (3,) at one metre (sun:
    everywhere).
    """

    kind: Literal["sun", "spot", "point"]
    intensity: Vector
    position_m: Vector | None = None
    direction: Vector | None = None
    half_angle_deg: float = 60.0
    casts_shadow: bool = False


@dataclass(frozen=True, eq=False)
class Room:
    """A place in world coordinates; `sky` and `ground` (3,) are linear RGB of the ambient light
    from above and below.
    """

    name: str
    props: tuple[Prop, ...]
    lights: tuple[Light, ...]
    sky: Vector
    ground: Vector
    background_srgb: tuple[int, int, int] = (0, 0, 0)


FIRST_SHAPES: Final = 6
"""How many shapes of the face there were when checksums of pictures were first recorded."""


@dataclass(frozen=True, eq=False)
class PosedPeople:
    """Everyone in one frame, n people in the order of the cast.

    `root_m` (n, 3) hips in world, `orientation_wxyz` (n, 55, 4) of every canonical joint against
    its parent (the root's in world), `morphs_01` (n, len(MORPHS)) weights of the face's shapes.
    """

    root_m: npt.NDArray[np.float64]
    orientation_wxyz: npt.NDArray[np.float64]
    morphs_01: npt.NDArray[np.float64]

    @property
    def parts_moved(self) -> tuple[npt.NDArray[np.float64], ...]:
        """All that poses people, for checksums, which must stay those of older recordings: shapes
        that came after the first six are left out while nobody wears them.
        """
        shapes = self.morphs_01
        if not shapes[:, FIRST_SHAPES:].any():
            shapes = shapes[:, :FIRST_SHAPES]
        return self.root_m, self.orientation_wxyz, shapes


@dataclass(frozen=True, eq=False)
class PlacedProp:
    """A prop that moves: `pose` leads from its own frame to world."""

    prop: Prop
    pose: Pose


@dataclass(frozen=True)
class Panel:
    """A board of text in the world: a question, a rating scale, an instruction.

    `choices` are drawn below the text in `rows`, the one at `highlighted` is lit, the one at
    `chosen` is marked; `keys` are the keys that take them, drawn in their corners. `ends` stand
    below the first and the last choice, `hint` at the lower edge. `pose` is the board's centre,
    its front towards +z of the pose; `size_m` is width and height. `tracks` are
    names between text and choices, one below the other, each with a track beside it.
    """

    text: str
    choices: tuple[str, ...]
    pose: Pose
    size_m: tuple[float, float]
    highlighted: int | None = None
    chosen: int | None = None
    rows: int = 1
    keys: tuple[str, ...] = ()
    ends: tuple[str, str] = ("", "")
    hint: str = ""
    tracks: tuple[str, ...] = ()

    @property
    def additions(self) -> tuple[object, ...]:
        """What a board has beside text and choices in one row; () for most in headsets."""
        more = (self.rows, self.keys, self.ends, self.hint, self.tracks)
        return () if more == (1, (), ("", ""), "", ()) else more


@dataclass(frozen=True, eq=False)
class Sheet:
    """A flat picture in the world, in the sRGB values of its pixels whatever lamps there are.

    `pixels` (h, w, 4) are sRGB bytes with opacity, top row first, the same object for the same
    content; `pose` and `size_m` are as those of a `Panel`. With `is_exact` they are meant to fall
    on the display's own pixels. Sheets of one `course` show one thing that moves, one at a time.
    """

    pixels: npt.NDArray[np.uint8]
    pose: Pose
    size_m: tuple[float, float]
    is_exact: bool = False
    course: object = None


@dataclass(frozen=True, eq=False)
class Surround:
    """A picture all around and infinitely far, in the sRGB values of its pixels.

    `eyes` (h, 2 h, 3 or 4) are what one eye (of both) or two see, the left first: equirectangular,
    top row first, the middle straight ahead (−z), the same objects for the same content.
    `orientation_wxyz` leads from there to world; `crc32` is of the pixels. Those of one `course`
    show one film, one picture at a time.
    """

    eyes: tuple[npt.NDArray[np.uint8], ...]
    orientation_wxyz: Vector
    crc32: int
    course: object = None


@dataclass(frozen=True, eq=False)
class Picture:
    """Everything in front of a camera at `t_ns`.

    A `surround` is behind everything. `sheets` are drawn over the scene, the last in front, a
    `veil` over them, and panels over it. `brightness_01` fades everything but the mark, surround,
    sheets, veil and panels to black; `mark_m` (3,) is where the fixation mark stands, or None.
    """

    t_ns: int
    room: Room
    cast: tuple[Character, ...]
    people: PosedPeople
    moving: tuple[PlacedProp, ...] = ()
    panels: tuple[Panel, ...] = ()
    brightness_01: float = 1.0
    mark_m: Vector | None = None
    sheets: tuple[Sheet, ...] = ()
    surround: Surround | None = None
    veil: Veil | None = None


@dataclass(frozen=True, eq=False)
class Camera:
    """One eye: `pose` in world (looks along −z), tangents of the frustum's edges (left and bottom
    negative) and clipping distances.
    """

    pose: Pose
    left: float
    right: float
    bottom: float
    top: float
    near_m: float = 0.05
    far_m: float = 100.0

"""Overlays on a scene: panels of text, the fixation mark, and what covers all but a window; and a
picture all around it.
"""

from typing import Any

import moderngl
import numpy as np

from visavis.lab.geometry import Vector, quat_conjugate, rotate
from visavis.stage.card.context import GL_FRAMEBUFFER_SRGB
from visavis.stage.card.programs import compile_program, set_bytes
from visavis.stage.card.shaders import room as glsl_room
from visavis.stage.card.targets import EyeTarget
from visavis.stage.geometry.projection import for_gl, world_from
from visavis.stage.panel_image import panel_image
from visavis.stimuli.gaze_window import Veil
from visavis.stimuli.picture import Camera, Panel, Picture, Sheet, Surround

MARK_HALF_DEG = 0.45
PANELS_KEPT = 24
MAX_SHEETS = 48
MAX_SURROUNDS = 4
"""Eyes' panoramas on the card: of 8k each takes 130 megabytes there."""


class Overlays:
    """Panels and marks; both are drawn over everything, even over nearer things."""

    def __init__(self, context: moderngl.Context, *, in_light: bool) -> None:
        self._context = context
        self._in_light = in_light
        self._defines = ("IN_LIGHT",) if in_light else ()
        corners = np.array([[-1, -1], [1, -1], [-1, 1], [1, 1]], np.float32) / 2
        self._corners = context.buffer(corners.tobytes())
        self._panels: dict[tuple[object, ...], moderngl.Texture] = {}
        self._sheets: dict[int, tuple[object, object, moderngl.Texture]] = {}
        self._surrounds: dict[tuple[int, int], tuple[object, object, moderngl.Texture]] = {}
        self._arrays: dict[str, moderngl.VertexArray] = {}
        self._programs: dict[str, moderngl.Program] = {}

    def draw(self, picture: Picture, camera: Camera, target: EyeTarget, eye: int = 0) -> None:
        """Draw what is around an eye, and veil, panels and mark over the picture in a target."""
        has_more = picture.panels or picture.sheets or picture.surround or picture.veil
        if not has_more and picture.mark_m is None:
            return
        context = self._context
        context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
        if picture.surround is not None:
            self._around(picture.surround, camera, eye)
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        for sheet in picture.sheets:
            matrix = world_from(sheet.pose) @ np.diag([*sheet.size_m, 1.0, 1.0])
            self._sheet(sheet).use(2)
            self._board("panel", glsl_room.BOARD_FRAGMENT, matrix)
        if picture.veil is not None:
            self._cover(picture.veil, camera, target)
        for panel in picture.panels:
            matrix = world_from(panel.pose) @ np.diag([*panel.size_m, 1.0, 1.0])
            self._texture(panel).use(2)
            self._board("panel", glsl_room.BOARD_FRAGMENT, matrix)
        if picture.mark_m is not None:
            self._board("mark", glsl_room.MARK_FRAGMENT, _mark_matrix(picture.mark_m, camera))
        context.disable(moderngl.BLEND)
        context.enable(moderngl.DEPTH_TEST | moderngl.CULL_FACE)

    def send(self, surround: Surround, eye: int) -> moderngl.Texture:
        """Return the texture of what an eye sees of a panorama, one for all of a course; its pixels
        are sent where they are not there yet.
        """
        pixels = surround.eyes[eye]
        owner: object = pixels if surround.course is None else surround.course
        entry = self._surrounds.get((id(owner), eye))
        if entry is not None and entry[1] is pixels:
            return entry[2]
        if entry is not None:
            texture = entry[2]
            texture.write(pixels, alignment=1)
        else:
            while len(self._surrounds) >= MAX_SURROUNDS:
                self._surrounds.pop(next(iter(self._surrounds)))[2].release()
            height, width, channels = pixels.shape
            texture = self._context.texture((width, height), channels, pixels, alignment=1)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.repeat_x, texture.repeat_y = True, False
        self._surrounds[id(owner), eye] = owner, pixels, texture
        return texture

    def _around(self, surround: Surround, camera: Camera, eye: int) -> None:
        content = [(self._corners, "2f4", "in_corner")]
        array = self._array(
            "surround", glsl_room.SURROUND_VERTEX, glsl_room.SURROUND_FRAGMENT, content
        )
        matrix = _picture_from_corner(surround, camera).T.astype(np.float32)
        set_bytes(self._programs["surround"], "picture_from_corner", matrix.tobytes())
        self.send(surround, min(eye, len(surround.eyes) - 1)).use(2)
        array.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _cover(self, veil: Veil, camera: Camera, target: EyeTarget) -> None:
        window, place = veil.window, veil.place
        content = [(self._corners, "2f4", "in_corner")]
        array = self._array("veil", glsl_room.SURROUND_VERTEX, glsl_room.VEIL_FRAGMENT, content)
        blur_px = window.blur_deg * np.radians(1) * target.size_px[0] / (camera.right - camera.left)
        if window.blur_deg:
            target.copy().use(2)
            if self._in_light:
                self._context.enable_direct(GL_FRAMEBUFFER_SRGB)
        is_lost = place.t_sample_ns is None
        half_deg, edge_deg = window.window_deg / 2, window.edge_deg / 2
        rim_rad = np.radians((half_deg - edge_deg, half_deg + edge_deg))
        from_eye = np.zeros(3) if is_lost else camera.pose.position_m - place.eye_m
        for name, values in (
            ("picture_from_corner", _ray_from_corner(camera).T),
            ("from_eye", from_eye / veil.distance_m),
            ("towards", np.zeros(3) if is_lost else place.direction),
            ("rim", 2 * np.sin(rim_rad / 2)),
            ("kind", (is_lost, window.is_around)),
            ("colour", (*np.array(veil.colour_srgb) / 255, 1.0)),
            ("blur_px", (blur_px,)),
        ):
            set_bytes(self._programs["veil"], name, np.asarray(values, np.float32).tobytes())
        array.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _board(self, name: str, fragment: str, matrix: Vector) -> None:
        array = self._array(
            name, glsl_room.BOARD_VERTEX, fragment, [(self._corners, "2f4", "in_corner")]
        )
        set_bytes(self._programs[name], "world_from_board", for_gl(matrix))
        array.render(moderngl.TRIANGLE_STRIP, vertices=4)

    def _array(
        self, name: str, vertex: str, fragment: str, content: list[tuple[Any, ...]]
    ) -> moderngl.VertexArray:
        if name not in self._arrays:
            program = compile_program(self._context, vertex, fragment, *self._defines)
            self._programs[name] = program
            self._arrays[name] = self._context.vertex_array(program, content)
        return self._arrays[name]

    def _sheet(self, sheet: Sheet) -> moderngl.Texture:
        """Return the texture of a sheet, one for all of a course; what it is found by is held, so
        that its identity stays.
        """
        owner: object = sheet.pixels if sheet.course is None else sheet.course
        entry = self._sheets.get(id(owner))
        if entry is not None and entry[1] is not sheet.pixels:
            _, _, texture = entry
            texture.write(np.ascontiguousarray(sheet.pixels).tobytes())
            if not sheet.is_exact:
                texture.build_mipmaps()
            entry = self._sheets[id(owner)] = owner, sheet.pixels, texture
        if entry is None:
            while len(self._sheets) >= MAX_SHEETS:
                self._sheets.pop(next(iter(self._sheets)))[2].release()
            height, width = sheet.pixels.shape[:2]
            pixels = np.ascontiguousarray(sheet.pixels)
            texture = self._texture_of((width, height), pixels.tobytes())
            if sheet.is_exact:
                # Smaller copies and skewed views would blend pixels that are the display's own.
                texture.filter, texture.anisotropy = (moderngl.LINEAR, moderngl.LINEAR), 1.0
            entry = self._sheets[id(owner)] = owner, sheet.pixels, texture
        return entry[2]

    def _texture_of(self, size_px: tuple[int, int], pixels: bytes) -> moderngl.Texture:
        texture = self._context.texture(size_px, 4, pixels)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.anisotropy = 8.0
        texture.repeat_x = texture.repeat_y = False
        return texture

    def _texture(self, panel: Panel) -> moderngl.Texture:
        usual = (panel.text, panel.choices, panel.size_m, panel.highlighted, panel.chosen)
        key = (*usual, *panel.additions)
        texture = self._panels.get(key)
        if texture is None:
            while len(self._panels) >= PANELS_KEPT:
                self._panels.pop(next(iter(self._panels))).release()
            image = panel_image(panel)
            height, width = image.shape[:2]
            texture = self._texture_of((width, height), image.tobytes())
            self._panels[key] = texture
        return texture

    def release(self) -> None:
        """Free the card's memory."""
        for things in (self._arrays, self._programs, self._panels):
            for thing in things.values():
                thing.release()
        for _, _, texture in self._sheets.values():
            texture.release()
        for _, _, texture in self._surrounds.values():
            texture.release()
        self._corners.release()


def _picture_from_corner(surround: Surround, camera: Camera) -> Vector:
    """Return what leads from a place in an eye's picture, each way from -0.5 to 0.5, and 1, to a
    direction in the panorama, (3, 3).
    """
    back = quat_conjugate(surround.orientation_wxyz)
    matrix: Vector = np.stack([rotate(back, axis) for axis in np.eye(3)], axis=1)
    return matrix @ _ray_from_corner(camera)


def _ray_from_corner(camera: Camera) -> Vector:
    """Return what leads from such a place to a direction in world, (3, 3)."""
    wide, high = camera.right - camera.left, camera.top - camera.bottom
    middle = (camera.left + camera.right) / 2, (camera.bottom + camera.top) / 2
    ray = np.array([[wide, 0.0, middle[0]], [0.0, high, middle[1]], [0.0, 0.0, -1.0]])
    turn = camera.pose.orientation_wxyz
    matrix: Vector = np.stack([rotate(turn, axis) for axis in np.eye(3)], axis=1) @ ray
    return matrix


def _mark_matrix(mark_m: Vector, camera: Camera) -> Vector:
    """Return where the mark stands: facing the eye, the same size however far."""
    matrix = world_from(camera.pose)
    distance_m = float(np.linalg.norm(np.asarray(mark_m) - camera.pose.position_m))
    size = 2 * distance_m * float(np.tan(np.radians(MARK_HALF_DEG)))
    matrix[:3, :3] *= size
    matrix[:3, 3] = mark_m
    return matrix

"""The shaders of people and rooms, compiled per kind of surface, lamps and pass."""

from typing import Literal

import moderngl

from visavis.stage.card.programs import EACH_SAMPLE, compile_program
from visavis.stage.card.shaders import lighting as glsl_lighting
from visavis.stage.card.shaders import people as glsl_people
from visavis.stage.card.shaders import room as glsl_room
from visavis.stage.card.vertices import Run

Family = Literal["people", "lit_people", "room", "baked_room"]
"""People skinned by the card or lit by the processor; things lit as drawn or beforehand."""


SAMPLE_SHADING = {"GL_ARB_gpu_shader5", "GL_ARB_sample_shading"}
"""Extensions of drivers that can shade every sample of a pixel by itself."""


class LitPrograms:
    """Programs by what they draw, compiled at first use."""

    def __init__(
        self,
        context: moderngl.Context,
        *,
        fast: bool,
        shadows: bool,
        area: bool,
        in_light: bool,
        shrink_factor: int = 1,
    ) -> None:
        self._context = context
        self._common = (
            *(("FAST_TONE", "CODE_TEXTURES") if fast else ()),
            *(("SHADOWS",) if shadows else ()),
            *(("AREA_LAMPS",) if shadows and area else ()),
            *(("IN_LIGHT",) if in_light else ()),
            *((f"SHRUNK {shrink_factor:.1f}",) if shrink_factor > 1 else ()),
        )
        self._fast = fast
        self._in_samples = in_light and SAMPLE_SHADING <= context.extensions
        self._programs: dict[tuple[object, ...], moderngl.Program] = {}

    def lit(self, family: Family, run: Run, lamps: str, *, identity: bool) -> moderngl.Program:
        """Return the program for triangles that look like `run` under these lamps."""
        channels = 0 if run.texture is None else run.texture.shape[2]
        has_surface = run.maps is not None and run.maps.surface is not None
        key = (family, run.kind, channels, run.maps is None, has_surface, lamps, identity)
        program = self._programs.get(key)
        if program is None:
            program = self._programs[key] = self._compile(family, run, lamps, identity=identity)
        return program

    def outline(self, family: Family) -> moderngl.Program:
        """Return the program that draws into a shadow map."""
        key = (family,)
        if key not in self._programs:
            vertex = glsl_people.SHADOW_VERTEX if family == "people" else glsl_room.SHADOW_VERTEX
            self._programs[key] = compile_program(
                self._context, vertex, glsl_people.SHADOW_FRAGMENT
            )
        return self._programs[key]

    def depth(self, family: Family) -> moderngl.Program:
        """Return the program that draws depth alone as the camera sent sees it."""
        key = (family, "depth")
        if key not in self._programs:
            vertex = glsl_people.DEPTH_VERTEX if family == "people" else glsl_room.DEPTH_VERTEX
            self._programs[key] = compile_program(self._context, vertex, glsl_people.DEPTH_FRAGMENT)
        return self._programs[key]

    def skinning(self) -> moderngl.Program:
        """Return the program that moves people into their poses."""
        key = ("skinning",)
        if key not in self._programs:
            self._programs[key] = compile_program(
                self._context,
                glsl_people.SKIN_VERTEX,
                None,
                "NO_SHINE",
                constants=glsl_lighting.lamp_constants((), ()),
                varyings=glsl_people.SKINNED_VARYINGS,
            )
        return self._programs[key]

    def release(self) -> None:
        """Free the card's memory."""
        for program in self._programs.values():
            program.release()
        self._programs.clear()

    def _compile(self, family: Family, run: Run, lamps: str, *, identity: bool) -> moderngl.Program:
        is_room = family in ("room", "baked_room")
        source = glsl_room if is_room else glsl_people
        vertex = glsl_people.LIT_VERTEX if family == "lit_people" else source.VERTEX
        defines = [*self._common]
        if run.texture is not None:
            defines.append("TEXTURED")
            if run.texture.shape[2] == 4:
                defines.append("CUT_OUT")
        if run.maps is not None and not self._fast:
            defines.append("MAPPED")
            if run.maps.surface is not None:
                defines.append("SURFACE_MAP")
        if run.kind in glsl_people.SHADERS:
            defines.append(glsl_people.SHADERS[run.kind])
        if run.kind == "eye" and not is_room and self._in_samples:
            defines.append(EACH_SAMPLE)
        if self._fast and (is_room or run.kind != "eye"):
            defines.append("VERTEX_LIT")
            if not identity:
                defines.append("IN_CODES")
        if family == "baked_room":
            defines.append("BAKED")
        if (run.kind == "cloth" and run.maps is None) or (is_room and self._fast):
            defines.append("NO_SHINE")
        output = glsl_lighting.OUTPUT_IDENTITY if identity else glsl_lighting.OUTPUT_COLOUR
        fragment = source.FRAGMENT.replace("//OUTPUT//", output)
        try:
            return compile_program(self._context, vertex, fragment, *defines, constants=lamps)
        except moderngl.Error:
            if EACH_SAMPLE not in defines:
                raise
        # The driver lists the extensions but fails to compile with them.
        defines.remove(EACH_SAMPLE)
        return compile_program(self._context, vertex, fragment, *defines, constants=lamps)

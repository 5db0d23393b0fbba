"""Compile shaders and set their inputs by name."""

from collections.abc import Mapping

import moderngl

HEAD = "#version 330 core\n"
EACH_SAMPLE = "EACH_SAMPLE"
"""Shader symbol that is defined when every sample of a pixel is shaded separately."""
SAMPLE_EXTENSION = "#extension GL_ARB_gpu_shader5 : require\n"
UNITS: Mapping[str, int] = {
    "joint_rows": 0,
    "morph_deltas": 1,
    "picture": 2,
    "shadow_map_0": 3,
    "shadow_map_1": 4,
    "normal_map": 5,
    "surface_map": 6,
    "glow_map": 7,
    "sheen_map": 8,
    "sources": 9,
    "chunks": 10,
    "shadow_depth_0": 11,
    "shadow_depth_1": 12,
    "blocks": 13,
    "shadow_bounds": 14,
}
"""Texture unit of every sampler, the same in all shaders."""
BLOCKS: Mapping[str, int] = {"Frame": 0, "Lighting": 1}


def compile_program(
    context: moderngl.Context,
    vertex: str,
    fragment: str | None,
    *defines: str,
    constants: str = "",
    varyings: tuple[str, ...] = (),
) -> moderngl.Program:
    """Compile, and point samplers and blocks to their fixed places."""
    head = HEAD + (SAMPLE_EXTENSION if EACH_SAMPLE in defines else "")
    head += "".join(f"#define {name}\n" for name in defines) + constants
    program = context.program(
        vertex_shader=head + vertex,
        fragment_shader=None if fragment is None else head + fragment,
        varyings=varyings,
    )
    for name in program:
        member = program[name]
        if isinstance(member, moderngl.Uniform) and name in UNITS:
            member.value = UNITS[name]
        elif isinstance(member, moderngl.UniformBlock):
            member.binding = BLOCKS[name]
    return program


def set_bytes(program: moderngl.Program, name: str, value: bytes) -> None:
    """Set a matrix; one the compiler found unused is left alone."""
    member = program.get(name, None)
    if isinstance(member, moderngl.Uniform):
        member.write(value)

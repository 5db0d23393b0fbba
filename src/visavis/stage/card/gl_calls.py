"""What the binding to OpenGL leaves out: many stretches drawn by one call, pictures in layers that
hold sRGB, depth copied from target to target, timers that are not waited for. Everything else that
draws goes through moderngl.
"""

import ctypes
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from visavis.stage.errors import StageError

GL_TRIANGLES, GL_UNSIGNED_BYTE, GL_UNSIGNED_INT = 0x0004, 0x1401, 0x1405
GL_TEXTURE_2D_ARRAY, GL_UNPACK_ALIGNMENT = 0x8C1A, 0x0CF5
GL_READ_FRAMEBUFFER, GL_DEPTH_BUFFER_BIT, GL_NEAREST = 0x8CA8, 0x0100, 0x2600
GL_RGB, GL_RGBA = 0x1907, 0x1908
GL_RGB8, GL_RGBA8, GL_SRGB8, GL_SRGB8_ALPHA8 = 0x8051, 0x8058, 0x8C41, 0x8C43

_u, _i, _p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
Told = ctypes.c_int | ctypes.c_uint | ctypes.c_uint64 | ctypes.Array[ctypes.c_uint]
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "glUseProgram": (_u,),
    "glBindVertexArray": (_u,),
    "glMultiDrawElementsBaseVertex": (_u, _p, _u, _p, _i, _p),
    "glPixelStorei": (_u, _i),
    "glBindFramebuffer": (_u, _u),
    "glBlitFramebuffer": (_i, _i, _i, _i, _i, _i, _i, _i, _u, _u),
    "glTexImage3D": (_u, _i, _i, _i, _i, _i, _i, _u, _u, _p),
    "glGenQueries": (_i, _p),
    "glDeleteQueries": (_i, _p),
    "glBeginQuery": (_u, _u),
    "glEndQuery": (_u,),
    "glGetQueryiv": (_u, _u, _p),
    "glGetQueryObjectuiv": (_u, _u, _p),
    "glGetQueryObjectui64v": (_u, _u, _p),
}


@dataclass(frozen=True, eq=False)
class Stretches:
    """Stretches (k,) of an index buffer of 4-byte indices, in triangles' corners: `first` and
    `count`; `base` is added to the indices of each.
    """

    count: npt.NDArray[np.int32]
    first_byte: npt.NDArray[np.intp]
    base: npt.NDArray[np.int32]

    @cached_property
    def addresses(self) -> tuple[int, int, int]:
        """Where count, first and base lie, for the driver."""
        return self.count.ctypes.data, self.first_byte.ctypes.data, self.base.ctypes.data

    @staticmethod
    def of(
        first: npt.NDArray[np.int64], count: npt.NDArray[np.int64], base: npt.NDArray[np.int64]
    ) -> "Stretches":
        """Return stretches as the driver reads them."""
        return Stretches(count.astype(np.int32), (4 * first).astype(np.intp), base.astype(np.int32))


class GlCalls:
    """OpenGL 3.3 functions of the driver that are called directly."""

    def __init__(self, context: moderngl.Context) -> None:
        loader = context.mglo._context  # noqa: SLF001 - the binding's own, without another door
        self._functions: dict[str, Any] = {}
        for name, arguments in _FUNCTIONS.items():
            address = loader.load_opengl_function(name)
            if not address:
                raise StageError(
                    f"the graphics driver lacks {name}", remedy="update the graphics driver"
                )
            self._functions[name] = ctypes.CFUNCTYPE(None, *arguments)(address)

    def copy_depth(self, source: moderngl.Framebuffer, into: moderngl.Framebuffer) -> None:
        """Copy depth between targets of one size and format; `into` is drawn into from then on."""
        into.use()
        corners = (0, 0, *source.size)
        self._functions["glBindFramebuffer"](GL_READ_FRAMEBUFFER, source.glo)
        self._functions["glBlitFramebuffer"](*corners, *corners, GL_DEPTH_BUFFER_BIT, GL_NEAREST)
        into.use()

    def draw(self, array: moderngl.VertexArray, stretches: Stretches) -> None:
        """Draw stretches of triangles of an array's index buffer by one call."""
        call = self._functions
        count, first_byte, base = stretches.addresses
        call["glUseProgram"](array.program.glo)
        call["glBindVertexArray"](array.glo)
        call["glMultiDrawElementsBaseVertex"](
            GL_TRIANGLES, count, GL_UNSIGNED_INT, first_byte, len(stretches.count), base
        )

    def query(self, name: str, *arguments: int | Told) -> None:
        """Call a timer function of the driver; its result is written into the last argument."""
        addresses = [a if isinstance(a, int) else ctypes.addressof(a) for a in arguments]
        self._functions[name](*addresses)

    def fill_srgb(self, array: moderngl.TextureArray, pixels: bytes) -> None:
        """Give an array of 3 or 4 channels its pixels as sRGB, which is decoded when read."""
        kept_as = GL_SRGB8_ALPHA8 if array.components == 4 else GL_SRGB8
        self._fill(array, pixels, 0, kept_as)

    def fill_smaller(self, array: moderngl.TextureArray, level: int, pixels: bytes) -> None:
        """Give an array of 3 or 4 channels the pixels of a copy, halved `level` times."""
        self._fill(array, pixels, level, GL_RGBA8 if array.components == 4 else GL_RGB8)

    def _fill(self, array: moderngl.TextureArray, pixels: bytes, level: int, kept_as: int) -> None:
        array.use(0)
        self._functions["glPixelStorei"](GL_UNPACK_ALIGNMENT, 1)
        self._functions["glTexImage3D"](
            GL_TEXTURE_2D_ARRAY,
            level,
            kept_as,
            max(array.width >> level, 1),
            max(array.height >> level, 1),
            array.layers,
            0,
            GL_RGBA if array.components == 4 else GL_RGB,
            GL_UNSIGNED_BYTE,
            pixels,
        )

"""The OpenGL context that is current in this thread: whose it is, and its functions.

Headset runtimes are handed a context that something else made, and copy textures within it. Only
what that takes is here; nothing draws. EGL and GLX on Linux, WGL on Windows.
"""

import ctypes
import ctypes.util
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lab.errors import DeviceError

TEXTURE_2D, RGBA, UNSIGNED_BYTE = 0x0DE1, 0x1908, 0x1401
TEXTURE_WIDTH, TEXTURE_HEIGHT = 0x1000, 0x1001
TEXTURE_BINDING_2D, PACK_ALIGNMENT, PIXEL_PACK_BUFFER = 0x8069, 0x0D05, 0x88EB
READ_FRAMEBUFFER, DRAW_FRAMEBUFFER, COLOR_ATTACHMENT0 = 0x8CA8, 0x8CA9, 0x8CE0
READ_BINDING, DRAW_BINDING = 0x8CAA, 0x8CA6
COLOR_BUFFER_BIT, NEAREST, FRAMEBUFFER_SRGB, SCISSOR_TEST = 0x4000, 0x2600, 0x8DB9, 0x0C11
FRAMEBUFFER_COMPLETE = 0x8CD5
SRGB8_ALPHA8 = 0x8C43

_EGL_CONFIG_ID, _GLX_FBCONFIG_ID, _GLX_VISUAL_ID = 0x3028, 0x8013, 0x800B
_REMEDY = "let the same thread open the window (or the off-screen context) first"

_u, _i, _p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "glGetError": (),
    "glGetIntegerv": (_u, _p),
    "glBindTexture": (_u, _u),
    "glGetTexLevelParameteriv": (_u, _i, _u, _p),
    "glGetTexImage": (_u, _i, _u, _u, _p),
    "glPixelStorei": (_u, _i),
    "glGenTextures": (_i, _p),
    "glDeleteTextures": (_i, _p),
    "glTexImage2D": (_u, _i, _i, _i, _i, _i, _u, _u, _p),
    "glTexParameteri": (_u, _u, _i),
    "glGenFramebuffers": (_i, _p),
    "glDeleteFramebuffers": (_i, _p),
    "glBindFramebuffer": (_u, _u),
    "glFramebufferTexture2D": (_u, _u, _u, _u, _i),
    "glCheckFramebufferStatus": (_u,),
    "glBlitFramebuffer": (_i, _i, _i, _i, _i, _i, _i, _i, _u, _u),
    "glIsEnabled": (_u,),
    "glEnable": (_u,),
    "glDisable": (_u,),
    "glFlush": (),
}
_RESULTS = {"glGetError": _u, "glCheckFramebufferStatus": _u, "glIsEnabled": ctypes.c_ubyte}


@dataclass(frozen=True)
class GlContext:
    """A current context by its handles, as numbers; `load` finds a GL function's address.

    `display` is the EGL or X display or the Windows device context; `config`, `visual` and
    `drawable` are 0 where the system has no such thing.
    """

    system: Literal["egl", "glx", "wgl"]
    display: int
    context: int
    config: int
    drawable: int
    visual: int
    load: Callable[[str], int]


def current_context() -> GlContext:
    """Return the context that is current in this thread.

    Raises:
        DeviceError: none is.
    """
    finders = (_wgl,) if sys.platform == "win32" else (_egl, _glx)
    for find in finders:
        found = find()
        if found is not None:
            return found
    raise DeviceError("no OpenGL context is current in this thread", remedy=_REMEDY)


class GlCopies:
    """Copy and read textures of the current context; leaves its state as it was."""

    def __init__(self, context: GlContext) -> None:
        self._functions = {name: _function(context, name) for name in _SIGNATURES}
        self._frames = (_u * 2)()
        self("glGenFramebuffers", 2, self._frames)

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call a GL function."""
        return self._functions[name](*arguments)

    def copy(self, source: int, target: int, size_px: tuple[int, int]) -> str:
        """Copy a texture's bytes into another of this size; return what went wrong, or nothing."""
        drawn, read = self._integer(DRAW_BINDING), self._integer(READ_BINDING)
        enabled = [cap for cap in (FRAMEBUFFER_SRGB, SCISSOR_TEST) if self("glIsEnabled", cap)]
        for cap in enabled:
            self("glDisable", cap)
        self._forget_errors()
        problem = ""
        for frame, texture, role in (
            (self._frames[0], source, READ_FRAMEBUFFER),
            (self._frames[1], target, DRAW_FRAMEBUFFER),
        ):
            self("glBindFramebuffer", role, frame)
            self("glFramebufferTexture2D", role, COLOR_ATTACHMENT0, TEXTURE_2D, texture, 0)
            if self("glCheckFramebufferStatus", role) != FRAMEBUFFER_COMPLETE:
                problem = f"texture {texture} cannot be copied"
        if not problem:
            box = (0, 0, *size_px)
            self("glBlitFramebuffer", *box, *box, COLOR_BUFFER_BIT, NEAREST)
            error = self("glGetError")
            problem = f"GL error 0x{error:04x}" if error else ""
        self._forget_errors()
        self("glBindFramebuffer", READ_FRAMEBUFFER, read)
        self("glBindFramebuffer", DRAW_FRAMEBUFFER, drawn)
        for cap in enabled:
            self("glEnable", cap)
        self("glFlush")
        return problem

    def read(self, texture: int) -> npt.NDArray[np.uint8]:
        """Return a texture as (height, width, 4) bytes as they lie there, top row first.

        Raises:
            DeviceError: there is no such texture.
        """
        bound, packing = self._integer(TEXTURE_BINDING_2D), self._integer(PACK_ALIGNMENT)
        self._forget_errors()
        self("glBindTexture", TEXTURE_2D, texture)
        size = (_i * 2)()
        for k, name in enumerate((TEXTURE_WIDTH, TEXTURE_HEIGHT)):
            self("glGetTexLevelParameteriv", TEXTURE_2D, 0, name, ctypes.byref(size, 4 * k))
        width, height = size
        image = np.zeros((height, width, 4), np.uint8)
        self("glPixelStorei", PACK_ALIGNMENT, 1)
        self("glGetTexImage", TEXTURE_2D, 0, RGBA, UNSIGNED_BYTE, image.ctypes.data)
        error = self("glGetError")
        self("glPixelStorei", PACK_ALIGNMENT, packing)
        self("glBindTexture", TEXTURE_2D, bound)
        if error or not width or not height:
            raise DeviceError(f"there is no texture {texture}", remedy="submit one that exists")
        return image[::-1]

    def texture(self, size_px: tuple[int, int], internal_format: int) -> int:
        """Make an empty texture and return its name."""
        bound, made = self._integer(TEXTURE_BINDING_2D), _u()
        self("glGenTextures", 1, ctypes.byref(made))
        self("glBindTexture", TEXTURE_2D, made)
        box = (*size_px, 0)
        self("glTexImage2D", TEXTURE_2D, 0, internal_format, *box, RGBA, UNSIGNED_BYTE, None)
        self("glTexParameteri", TEXTURE_2D, 0x2801, NEAREST)
        self("glBindTexture", TEXTURE_2D, bound)
        return int(made.value)

    def delete(self, textures: list[int]) -> None:
        """Free textures."""
        names = (_u * len(textures))(*textures)
        self("glDeleteTextures", len(textures), names)

    def close(self) -> None:
        """Free what copying needs; the context is current."""
        self("glDeleteFramebuffers", 2, self._frames)

    def _integer(self, name: int) -> int:
        value = _i()
        self("glGetIntegerv", name, ctypes.byref(value))
        return int(value.value)

    def _forget_errors(self) -> None:
        for _ in range(16):
            if not self("glGetError"):
                return


def _function(context: GlContext, name: str) -> Any:
    address = context.load(name)
    if not address:
        raise DeviceError(f"the graphics driver has no {name}", remedy="update it")
    return ctypes.CFUNCTYPE(_RESULTS.get(name), *_SIGNATURES[name])(address)


@cache
def _library(name: str, fallback: str) -> Any:
    try:
        return ctypes.CDLL(ctypes.util.find_library(name) or fallback)
    except OSError:
        return None


def _call(library: Any, name: str, result: Any, *arguments: Any) -> Any:
    function = getattr(library, name)
    function.restype = result
    return function(*arguments)


def _loader(library: Any, name: str) -> Callable[[str], int]:
    def load(function: str) -> int:
        return int(_call(library, name, _p, function.encode()) or 0)

    return load


def _egl() -> GlContext | None:
    egl = _library("EGL", "libEGL.so.1")
    context = _call(egl, "eglGetCurrentContext", _p) if egl is not None else None
    if not context:
        return None
    display = _p(_call(egl, "eglGetCurrentDisplay", _p))
    number, config, count = _i(), _p(), _i()
    _call(egl, "eglQueryContext", _u, display, _p(context), _EGL_CONFIG_ID, ctypes.byref(number))
    wanted = (_i * 3)(_EGL_CONFIG_ID, number.value, 0x3038)
    _call(egl, "eglChooseConfig", _u, display, wanted, ctypes.byref(config), 1, ctypes.byref(count))
    load = _loader(egl, "eglGetProcAddress")
    return GlContext("egl", display.value or 0, int(context), config.value or 0, 0, 0, load)


def _glx() -> GlContext | None:
    glx = _library("GL", "libGL.so.1")
    context = _call(glx, "glXGetCurrentContext", _p) if glx is not None else None
    if not context:
        return None
    display = _p(_call(glx, "glXGetCurrentDisplay", _p))
    drawable = int(_call(glx, "glXGetCurrentDrawable", ctypes.c_ulong))
    number, screen, visual, count = _i(), _i(), _i(), _i()
    handle = _p(context)
    _call(glx, "glXQueryContext", _i, display, handle, _GLX_FBCONFIG_ID, ctypes.byref(number))
    _call(glx, "glXQueryContext", _i, display, handle, 0x800C, ctypes.byref(screen))
    wanted = (_i * 3)(_GLX_FBCONFIG_ID, number.value, 0)
    found = _call(
        glx, "glXChooseFBConfig", ctypes.POINTER(_p), display, screen, wanted, ctypes.byref(count)
    )
    config = int(found[0] or 0) if found and count.value else 0
    if config:
        where = ctypes.byref(visual)
        _call(glx, "glXGetFBConfigAttrib", _i, display, _p(config), _GLX_VISUAL_ID, where)
    load = _loader(glx, "glXGetProcAddressARB")
    return GlContext("glx", display.value or 0, int(context), config, drawable, visual.value, load)


def _wgl() -> GlContext | None:
    gl = _library("opengl32", "opengl32.dll")
    context = _call(gl, "wglGetCurrentContext", _p) if gl is not None else None
    if not context:
        return None
    display = int(_call(gl, "wglGetCurrentDC", _p) or 0)
    extended = _loader(gl, "wglGetProcAddress")

    def load(function: str) -> int:
        """Look in the driver first, then among the functions of OpenGL 1.1."""
        address = extended(function)
        if address > 3 and address != 2**64 - 1:
            return address
        plain = getattr(gl, function, None)
        return 0 if plain is None else int(ctypes.cast(plain, _p).value or 0)

    return GlContext("wgl", display, int(context), 0, 0, 0, load)

"""The OpenGL context that is current in this thread: whose it is, and copies of its textures.

Headset runtimes get a context that another library made, and copy textures within it. This module
holds only what that needs and draws nothing. EGL and GLX on Linux, WGL on Windows.
"""

import ctypes
import ctypes.util
import sys
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DeviceError

SRGB8_ALPHA8 = 0x8C43

_EGL_CONFIG_ID, _GLX_FBCONFIG_ID, _GLX_VISUAL_ID = 0x3028, 0x8013, 0x800B
_REMEDY = "let the same thread open the window (or the off-screen context) first"

_u, _i, _p = ctypes.c_uint, ctypes.c_int, ctypes.c_void_p


@dataclass(frozen=True)
class GlContext:
    """A current context by its handles, as numbers.

    `display` is the EGL or X display or the Windows device context; `config`, `visual` and
    `drawable` are 0 where the system has no such thing.
    """

    system: Literal["egl", "glx", "wgl"]
    display: int
    context: int
    config: int
    drawable: int
    visual: int


def current_context() -> GlContext:
    """Return the context that is current in this thread.

    Raises:
        DeviceError: no context is current.
    """
    finders = (_wgl,) if sys.platform == "win32" else (_egl, _glx)
    for find in finders:
        context = find()
        if context is not None:
            return context
    raise DeviceError("no OpenGL context is current in this thread", remedy=_REMEDY)


def is_current(context: GlContext) -> bool:
    """Tell whether a context is the one that is current in this thread."""
    try:
        now = current_context()
    except DeviceError:
        return False
    return (now.system, now.context) == (context.system, context.context)


class GlCopies:
    """Copy and read textures of the context that is current; leaves its state as it was."""

    def __init__(self) -> None:
        self._gl = _functions()
        self._frames = [int(name) for name in self._gl.glGenFramebuffers(2)]

    def copy(self, source: int, target: int, size_px: tuple[int, int]) -> str:
        """Copy a texture's bytes into another of this size; return what went wrong, or nothing."""
        gl = self._gl
        roles = (
            (gl.GL_READ_FRAMEBUFFER, gl.GL_READ_FRAMEBUFFER_BINDING, self._frames[0], source),
            (gl.GL_DRAW_FRAMEBUFFER, gl.GL_DRAW_FRAMEBUFFER_BINDING, self._frames[1], target),
        )
        self._forget_errors()
        previous = [(role, int(gl.glGetIntegerv(binding))) for role, binding, _, _ in roles]
        features = [c for c in (gl.GL_FRAMEBUFFER_SRGB, gl.GL_SCISSOR_TEST) if gl.glIsEnabled(c)]
        for capability in features:
            gl.glDisable(capability)
        problem = ""
        try:
            for role, _, frame, texture in roles:
                gl.glBindFramebuffer(role, frame)
                place = (gl.GL_COLOR_ATTACHMENT0, gl.GL_TEXTURE_2D)
                gl.glFramebufferTexture2D(role, *place, texture, 0)
                if gl.glCheckFramebufferStatus(role) != gl.GL_FRAMEBUFFER_COMPLETE:
                    problem = f"texture {texture} cannot be copied"
            if not problem:
                box = (0, 0, *size_px)
                gl.glBlitFramebuffer(*box, *box, gl.GL_COLOR_BUFFER_BIT, gl.GL_NEAREST)
        except gl.GLError as error:
            problem = problem or f"GL error 0x{error.err:04x}"
        self._forget_errors()
        for role, frame in previous:
            gl.glBindFramebuffer(role, frame)
        for capability in features:
            gl.glEnable(capability)
        gl.glFlush()
        return problem

    def read(self, texture: int) -> npt.NDArray[np.uint8]:
        """Return a texture as (height, width, 4) bytes as they lie there, top row first.

        Raises:
            DeviceError: there is no such texture.
        """
        gl = self._gl
        self._forget_errors()
        bound = int(gl.glGetIntegerv(gl.GL_TEXTURE_BINDING_2D))
        packing = int(gl.glGetIntegerv(gl.GL_PACK_ALIGNMENT))
        try:
            gl.glBindTexture(gl.GL_TEXTURE_2D, texture)
            width, height = (
                int(gl.glGetTexLevelParameteriv(gl.GL_TEXTURE_2D, 0, name))
                for name in (gl.GL_TEXTURE_WIDTH, gl.GL_TEXTURE_HEIGHT)
            )
            image = np.zeros((height, width, 4), np.uint8)
            gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
            if image.size:
                form = (gl.GL_RGBA, gl.GL_UNSIGNED_BYTE)
                gl.glGetTexImage(gl.GL_TEXTURE_2D, 0, *form, image)
        except gl.GLError:
            image = np.zeros((0, 0, 4), np.uint8)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, packing)
        gl.glBindTexture(gl.GL_TEXTURE_2D, bound)
        if not image.size:
            raise DeviceError(f"there is no texture {texture}", remedy="submit one that exists")
        return image[::-1]

    def texture(self, size_px: tuple[int, int], internal_format: int) -> int:
        """Make an empty texture and return its name."""
        gl = self._gl
        previous, name = int(gl.glGetIntegerv(gl.GL_TEXTURE_BINDING_2D)), int(gl.glGenTextures(1))
        gl.glBindTexture(gl.GL_TEXTURE_2D, name)
        form = (internal_format, *size_px, 0, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE)
        gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, *form, None)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MIN_FILTER, gl.GL_NEAREST)
        gl.glBindTexture(gl.GL_TEXTURE_2D, previous)
        return name

    def delete(self, textures: list[int]) -> None:
        """Free textures."""
        self._gl.glDeleteTextures(textures)

    def close(self) -> None:
        """Free what copying needs; the context is current."""
        self._gl.glDeleteFramebuffers(2, self._frames)

    def _forget_errors(self) -> None:
        for _ in range(16):
            if not self._gl.glGetError():
                return


def _functions() -> Any:
    """Return PyOpenGL's functions.

    Raises:
        DeviceError: it is not installed, or finds no OpenGL.
    """
    try:
        from OpenGL import GL
    except ImportError as error:
        raise DeviceError(
            f"textures cannot be copied without PyOpenGL ({error})",
            remedy="run: pip install PyOpenGL",
        ) from error
    return GL


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


def _egl() -> GlContext | None:
    egl = _library("EGL", "libEGL.so.1")
    context = _call(egl, "eglGetCurrentContext", _p) if egl is not None else None
    if not context:
        return None
    display = _p(_call(egl, "eglGetCurrentDisplay", _p))
    number, config, count = _i(), _p(), _i()
    _call(egl, "eglQueryContext", _u, display, _p(context), _EGL_CONFIG_ID, ctypes.byref(number))
    query = (_i * 3)(_EGL_CONFIG_ID, number.value, 0x3038)
    _call(egl, "eglChooseConfig", _u, display, query, ctypes.byref(config), 1, ctypes.byref(count))
    return GlContext("egl", display.value or 0, int(context), config.value or 0, 0, 0)


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
    query = (_i * 3)(_GLX_FBCONFIG_ID, number.value, 0)
    configs = _call(
        glx, "glXChooseFBConfig", ctypes.POINTER(_p), display, screen, query, ctypes.byref(count)
    )
    config = int(configs[0] or 0) if configs and count.value else 0
    if config:
        where = ctypes.byref(visual)
        _call(glx, "glXGetFBConfigAttrib", _i, display, _p(config), _GLX_VISUAL_ID, where)
    return GlContext("glx", display.value or 0, int(context), config, drawable, visual.value)


def _wgl() -> GlContext | None:
    gl = _library("opengl32", "opengl32.dll")
    context = _call(gl, "wglGetCurrentContext", _p) if gl is not None else None
    if not context:
        return None
    display = int(_call(gl, "wglGetCurrentDC", _p) or 0)
    return GlContext("wgl", display, int(context), 0, 0, 0)

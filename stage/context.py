"""Open the graphics library: without a screen, or in a context that something else made."""

from typing import Any

import moderngl

from stage.errors import INSTALL_MESA, StageError

GL_VERSION = 330
GL_FRAMEBUFFER_SRGB = 0x8DB9
EGL: dict[str, Any] = {"backend": "egl"}


def offscreen_context() -> moderngl.Context:
    """Return a context that needs neither screen nor graphics card.

    Raises:
        StageError: there is no EGL, or no driver behind it, that knows OpenGL 3.3.
    """
    try:
        return moderngl.create_context(standalone=True, require=GL_VERSION, **EGL)
    except Exception as egl_problem:
        # The libraries below raise bare Exception, each with its own text.
        try:
            return moderngl.create_context(standalone=True, require=GL_VERSION)
        except Exception:
            raise StageError(
                f"nothing here can draw with OpenGL 3.3: {egl_problem}", remedy=INSTALL_MESA
            ) from egl_problem


def current_context() -> moderngl.Context:
    """Return the context that is current in this thread: of a window or of a headset runtime.

    Raises:
        StageError: no context is current, or it knows less than OpenGL 3.3.
    """
    try:
        return moderngl.create_context(require=GL_VERSION)
    except Exception as problem:
        raise StageError(
            f"the window's graphics context cannot be used: {problem}",
            remedy="update the graphics driver; it must know OpenGL 3.3",
        ) from problem


def draws_on_processor(context: moderngl.Context) -> bool:
    """Tell whether no graphics card draws, so that pictures are worth less work."""
    name = str(context.info.get("GL_RENDERER", "")).lower()
    return any(word in name for word in ("llvmpipe", "softpipe", "swiftshader", "software"))

"""Open the graphics library: off-screen, or in a context made elsewhere."""

import threading
import weakref
from typing import Any

import moderngl

from visavis.stage.errors import INSTALL_MESA, StageError

GL_VERSION = 330
GL_FRAMEBUFFER_SRGB = 0x8DB9
EGL: dict[str, Any] = {"backend": "egl"}


class _Open(threading.local):
    """The off-screen contexts of a thread that are not released, the current one last."""

    def __init__(self) -> None:
        self.contexts: list[weakref.ref[moderngl.Context]] = []


_OPEN = _Open()


def offscreen_context() -> moderngl.Context:
    """Return a context that needs neither screen nor graphics card, current in this thread until
    another one is made; `release_offscreen` gives it back.

    Raises:
        StageError: there is no EGL, or no driver behind it, that knows OpenGL 3.3.
    """
    context = _make_offscreen()
    _OPEN.contexts.append(weakref.ref(context))
    return context


def release_offscreen(context: moderngl.Context) -> None:
    """Release an off-screen context; the latest one made before it becomes current again."""
    context.release()
    _OPEN.contexts = [ref for ref in _OPEN.contexts if ref() not in (None, context)]
    before = _OPEN.contexts[-1]() if _OPEN.contexts else None
    if before is not None:
        before.__enter__()  # type: ignore[no-untyped-call]  # moderngl has no types for it


def _make_offscreen() -> moderngl.Context:
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
    """Return the current context of this thread, made by a window or a headset runtime.

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
    """Return whether the processor draws instead of a graphics card."""
    name = str(context.info.get("GL_RENDERER", "")).lower()
    return any(word in name for word in ("llvmpipe", "softpipe", "swiftshader", "software"))

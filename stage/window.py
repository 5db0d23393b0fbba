"""A window on the desktop to draw into; its keys."""

from typing import Any

import glfw

from stage.context import current_context
from stage.errors import StageError


class Window:
    """A desktop window with an OpenGL 3.3 context; in the main thread.

    Raises:
        StageError: there is no screen, or it cannot show OpenGL 3.3.
    """

    def __init__(self, title: str, size_px: tuple[int, int], *, samples: int = 0) -> None:
        glfw.set_error_callback(_keep_quiet)
        if not glfw.init():
            raise StageError(
                "no window can be opened: there is no screen",
                remedy="log in on a desktop; without one previews go to --png, --sheet or --video, "
                "and sessions take display.show: none or offscreen in lab_config.yaml",
            )
        glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 3)
        glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
        glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
        glfw.window_hint(glfw.OPENGL_FORWARD_COMPAT, glfw.TRUE)
        glfw.window_hint(glfw.SAMPLES, samples)
        self._window: Any = glfw.create_window(*size_px, title, None, None)
        if not self._window:
            glfw.terminate()
            raise StageError(
                "no window could be opened with OpenGL 3.3", remedy="update the graphics driver"
            )
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)
        self.context = current_context()
        self._keys: list[str] = []
        glfw.set_key_callback(self._window, self._take_key)
        glfw.set_char_callback(self._window, self._take_char)

    @property
    def closed(self) -> bool:
        """Whether the operator has closed it."""
        return self._window is None or bool(glfw.window_should_close(self._window))

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of what is drawn in it."""
        width, height = glfw.get_framebuffer_size(self._window)
        return width, height

    def keys(self) -> tuple[str, ...]:
        """Return the keys pressed since the last call: characters or names such as "left"."""
        pressed, self._keys = tuple(self._keys), []
        return pressed

    def present(self) -> None:
        """Show what was drawn; take the system's events."""
        glfw.swap_buffers(self._window)
        glfw.poll_events()

    def close(self) -> None:
        """Close it; idempotent."""
        if self._window is not None:
            self.context.release()
            glfw.destroy_window(self._window)
            glfw.terminate()
            self._window = None

    def _take_key(self, _: object, key: int, __: int, action: int, ___: int) -> None:
        if action == glfw.PRESS and key in _NAMED_KEYS:
            self._keys.append(_NAMED_KEYS[key])

    def _take_char(self, _: object, code: int) -> None:
        self._keys.append(chr(code))


_NAMED_KEYS = {
    glfw.KEY_LEFT: "left",
    glfw.KEY_RIGHT: "right",
    glfw.KEY_ENTER: "enter",
    glfw.KEY_ESCAPE: "escape",
}


def _keep_quiet(code: int, message: str) -> None:
    """Leave errors to the return values, which say what to do."""

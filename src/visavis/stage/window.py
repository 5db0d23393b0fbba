"""A window on the desktop to draw into; its keys."""

from collections.abc import Callable
from typing import Any

import glfw

from visavis.stage.card.context import current_context
from visavis.stage.errors import StageError

HeardKey = Callable[[str, bool], None]
"""Called with a key's name and whether it was pressed, when the system reports it."""


class Window:
    """A desktop window with an OpenGL 3.3 context; in the main thread.

    With `monitor` (from 0) it fills that monitor and its pictures wait for the monitor's refresh;
    `size_px` must then be what the monitor shows.

    Raises:
        StageError: there is no screen, no such monitor, it has other pixels, or it cannot show
            OpenGL 3.3.
    """

    def __init__(
        self,
        title: str,
        size_px: tuple[int, int],
        *,
        samples: int = 0,
        monitor: int | None = None,
    ) -> None:
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
        full_monitor = None if monitor is None else _monitor(monitor, size_px)
        self._window: Any = glfw.create_window(*size_px, title, full_monitor, None)
        if not self._window:
            glfw.terminate()
            raise StageError(
                "no window could be opened with OpenGL 3.3", remedy="update the graphics driver"
            )
        glfw.make_context_current(self._window)
        glfw.swap_interval(0 if monitor is None else 1)
        if monitor is not None:
            glfw.set_input_mode(self._window, glfw.CURSOR, glfw.CURSOR_HIDDEN)
        self.context = current_context()
        self._keys: list[str] = []
        self._on_key: HeardKey | None = None
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
        keys, self._keys = tuple(self._keys), []
        return keys

    def hear_keys(self, on_key: HeardKey) -> None:
        """Tell every press and release by the key's name: what it types, or what it is ("left").

        Names follow the keyboard's layout, without shift: the key that types "A" is "a".
        """
        self._on_key = on_key

    def attend(self, seconds: float) -> None:
        """Take the system's events as they come; returns with the first, or after `seconds`."""
        if seconds > 0:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()

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

    def _take_key(self, _: object, key: int, scancode: int, action: int, __: int) -> None:
        if action == glfw.PRESS and key in _NAMED_KEYS:
            self._keys.append(_NAMED_KEYS[key])
        if self._on_key is not None and action in (glfw.PRESS, glfw.RELEASE):
            name = _NAMED_KEYS.get(key) or _OTHER_KEYS.get(key)
            name = name or glfw.get_key_name(key, scancode) or f"key {scancode}"
            self._on_key(name.lower(), action == glfw.PRESS)

    def _take_char(self, _: object, code: int) -> None:
        self._keys.append(chr(code))


_NAMED_KEYS = {
    glfw.KEY_LEFT: "left",
    glfw.KEY_RIGHT: "right",
    glfw.KEY_ENTER: "enter",
    glfw.KEY_ESCAPE: "escape",
}

_OTHER_KEYS = {
    glfw.KEY_UP: "up",
    glfw.KEY_DOWN: "down",
    glfw.KEY_SPACE: "space",
    glfw.KEY_TAB: "tab",
    glfw.KEY_BACKSPACE: "backspace",
    glfw.KEY_LEFT_SHIFT: "left_shift",
    glfw.KEY_RIGHT_SHIFT: "right_shift",
    glfw.KEY_LEFT_CONTROL: "left_control",
    glfw.KEY_RIGHT_CONTROL: "right_control",
    glfw.KEY_LEFT_ALT: "left_alt",
    glfw.KEY_RIGHT_ALT: "right_alt",
    glfw.KEY_KP_ENTER: "enter",
    **{getattr(glfw, f"KEY_KP_{n}"): str(n) for n in range(10)},
    **{getattr(glfw, f"KEY_F{n}"): f"f{n}" for n in range(1, 13)},
}


def _monitor(number: int, size_px: tuple[int, int]) -> Any:
    """Return the monitor to fill; raises StageError where it is not there or has other pixels."""
    monitors = glfw.get_monitors()
    modes = [glfw.get_video_mode(monitor).size for monitor in monitors]
    there = ", ".join(f"{i}: {size.width}×{size.height}" for i, size in enumerate(modes))
    if number >= len(monitors):
        glfw.terminate()
        raise StageError(
            f"there is no monitor {number}; there are {there or 'none'}",
            remedy="correct display.screen.monitor in lab_config.yaml",
        )
    if (modes[number].width, modes[number].height) != size_px:
        glfw.terminate()
        raise StageError(
            f"monitor {number} shows {modes[number].width}×{modes[number].height} pixels, "
            f"lab_config.yaml says {size_px[0]}×{size_px[1]}",
            remedy="set the monitor to its own resolution without scaling, and write its pixels "
            "under display.screen",
        )
    return monitors[number]


def _keep_quiet(code: int, message: str) -> None:
    """Leave errors to the return values, which say what to do."""

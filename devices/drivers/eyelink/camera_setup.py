"""Set the EyeLink's camera up and calibrate it, with targets drawn on the participant's screen.

The host computer leads: it says where a target belongs, and takes keys pressed at either computer
(C calibrates, V validates, Enter accepts, Esc ends). Without drawn targets it waits for ever.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, Protocol

from visavis.devices.drivers.eyelink.codec import screen_coordinates
from visavis.lab.errors import DeviceError, DeviceNotFound

RESULTS = {
    0: "the host calls the calibration good",
    1: "the host calls the calibration poor: calibrate again",
    27: "the calibration was ended with Esc",
    1000: "nothing was calibrated",
}
KEYS = {257: 13, 256: 27, 335: 13, 32: 32, 259: 8}
"""Keys of the window, as the host knows them: Enter, Esc, keypad Enter, space, backspace."""
TARGET_SHARE = 60
"""The target is a sixtieth of the screen's width, its middle a fifth of that."""


class TargetScreen(Protocol):
    """The participant's screen, in pixels from its top left."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        ...

    def show(self, target_px: tuple[float, float] | None) -> None:
        """Show a target here and nothing else, or an empty screen."""
        ...

    def keys(self) -> Sequence[int]:
        """Return the keys pressed since the last call, as the host knows them."""
        ...

    def close(self) -> None:
        """Give the screen back."""
        ...


def display_on(library: Any, screen: TargetScreen) -> Any:
    """Return an `EyeLinkCustomDisplay`, through which the library draws on a screen.

    The picture of the camera stays on the host's own display.
    """

    class Display(library.EyeLinkCustomDisplay):  # type: ignore[misc]  # the library has no types
        def setup_cal_display(self) -> None:
            screen.show(None)

        def clear_cal_display(self) -> None:
            screen.show(None)

        def erase_cal_target(self) -> None:
            screen.show(None)

        def exit_cal_display(self) -> None:
            screen.show(None)

        def record_abort_hide(self) -> None:
            screen.show(None)

        def draw_cal_target(self, x: float, y: float) -> None:
            screen.show((x, y))

        def get_input_key(self) -> list[Any] | None:
            return [library.KeyInput(key, 0) for key in screen.keys()] or None

        def get_mouse_state(self) -> None:
            return None

        def alert_printf(self, text: str) -> None:
            raise DeviceError(f"the EyeLink says: {text}")

        def play_beep(self, beep: int) -> None: ...
        def setup_image_display(self, width: int, height: int) -> int:
            return 0

        def exit_image_display(self) -> None: ...
        def image_title(self, title: str) -> None: ...
        def draw_image_line(self, width: int, line: int, lines: int, row: Any) -> None: ...
        def set_image_palette(self, red: Any, green: Any, blue: Any) -> None: ...
        def draw_line(self, *place: Any) -> None: ...
        def draw_lozenge(self, *place: Any) -> None: ...

    return Display()


def set_up(address: str | None, screen: TargetScreen, library: Any) -> str:
    """Let the host's setup run until Esc; return the result of the calibration in words.

    Raises:
        DeviceNotFound: no tracker answers there.
    """
    try:
        tracker = library.EyeLink(address)
    except RuntimeError as cause:
        raise DeviceNotFound(
            f"no EyeLink answers at {address} ({cause})",
            remedy="switch its host computer on, and check cable and `address`",
        ) from cause
    try:
        tracker.setOfflineMode()
        tracker.sendCommand(f"screen_pixel_coords = {screen_coordinates(screen.size_px)}")
        library.openGraphicsEx(display_on(library, screen))
        try:
            tracker.doTrackerSetup()
        finally:
            library.closeGraphics()
        code = int(tracker.getCalibrationResult())
        return RESULTS.get(code, f"the calibration failed (code {code})")
    finally:
        tracker.close()
        screen.close()


class FullScreen:
    """A whole monitor, grey, with one black target on it."""

    def __init__(self) -> None:
        import glfw
        import moderngl

        self._glfw = glfw
        if not glfw.init():
            raise DeviceError(
                "no screen to draw targets on", remedy="run it on the participant's computer"
            )
        monitor = glfw.get_primary_monitor()
        mode = glfw.get_video_mode(monitor)
        self.size_px = (int(mode.size.width), int(mode.size.height))
        self._window = glfw.create_window(*self.size_px, "Visavis", monitor, None)
        if not self._window:
            glfw.terminate()
            raise DeviceError(
                "the screen opens no window", remedy="look at the graphics driver: visavis doctor"
            )
        glfw.make_context_current(self._window)
        self._gl = moderngl.create_context()
        self._pressed_keys: deque[int] = deque()
        glfw.set_key_callback(self._window, self._take_key)

    def show(self, target_px: tuple[float, float] | None) -> None:
        """Show a target here and nothing else, or an empty screen."""
        gl, (width, height) = self._gl, self.size_px
        gl.screen.scissor = (0, 0, width, height)
        gl.screen.clear(0.5, 0.5, 0.5)
        if target_px is not None:
            outer = max(10, width // TARGET_SHARE)
            for side, shade in ((outer, 0.0), (max(2, outer // 5), 1.0)):
                left, bottom = target_px[0] - side / 2, height - target_px[1] - side / 2
                gl.screen.scissor = (round(left), round(bottom), side, side)
                gl.screen.clear(shade, shade, shade)
        self._glfw.swap_buffers(self._window)

    def keys(self) -> Sequence[int]:
        """Return the keys pressed since the last call, as the host knows them."""
        self._glfw.poll_events()
        key_codes = tuple(self._pressed_keys)
        self._pressed_keys.clear()
        return key_codes

    def close(self) -> None:
        """Give the screen back."""
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def _take_key(self, window: Any, key: int, scan: int, action: int, mods: int) -> None:
        if action == self._glfw.PRESS:
            letter = ord(chr(key).lower()) if 65 <= key <= 90 else None
            host_key = KEYS.get(key, letter)
            if host_key is not None:
                self._pressed_keys.append(host_key)

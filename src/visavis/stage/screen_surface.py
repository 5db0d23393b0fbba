"""Show pictures to a participant on a monitor, in its rhythm."""

from typing import TypeAlias

import moderngl

from visavis.lab.clock import NS_PER_MS, NS_PER_S, Clock
from visavis.stage.card.shaders.room import BOARD_FRAGMENT
from visavis.stage.square import Square
from visavis.stage.window import Window

MAX_WAIT_S = 0.25
Image: TypeAlias = moderngl.Texture


class ScreenSurface:
    """A window that shows one picture whole, and waits for the monitor.

    It follows `Surface` of the screen display: keys are heard while frames are waited for.
    """

    def __init__(self, window: Window, clock: Clock) -> None:
        self.window = window
        self._clock = clock
        self._square: Square | None = None
        self._context: moderngl.Context | None = None

    @property
    def closed(self) -> bool:
        """Whether somebody closed the window."""
        return self.window.closed

    def attend(self, until_ns: int) -> None:
        """Hear keys until a session time; the last part of a millisecond is slept."""
        self.window.attend(0.0)
        while (left_ns := until_ns - self._clock.now_ns()) > NS_PER_MS:
            self.window.attend(min((left_ns - NS_PER_MS // 2) / NS_PER_S, MAX_WAIT_S))
        if left_ns > 0:
            self._clock.sleep_until_ns(until_ns)

    def flip(self, image: Image) -> int:
        """Fill the window with the picture; return when the monitor took it."""
        context = self.window.context
        if self._square is None or context is not self._context:
            self._square, self._context = Square(context), context
        screen = context.screen
        screen.use()
        screen.viewport = (0, 0, *self.window.size_px)
        context.enable_only(moderngl.NOTHING)
        image.use(2)
        self._square.draw("picture", BOARD_FRAGMENT, (0.0, 0.0, 1.0, 1.0))
        self.window.present()
        context.finish()  # returns when the monitor took the picture, not when it was requested
        return self._clock.now_ns()

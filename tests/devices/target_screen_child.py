"""Show a target, then none, on a screen of its own, and print which pixels are dark."""

import sys

import numpy as np

from visavis.devices.drivers.eyelink.camera_setup import FullScreen


class _ReadingGlfw:
    """Stands before the window's library: reads the picture that is about to be shown."""

    def __init__(self, screen):
        self._screen, self._glfw = screen, screen._glfw

    def __getattr__(self, name):
        return getattr(self._glfw, name)

    def swap_buffers(self, window):
        width, height = self._screen.size_px
        pixels = np.frombuffer(self._screen._gl.screen.read(components=1), np.uint8)
        rows, columns = np.nonzero(pixels.reshape(height, width)[::-1] < 64)
        middle = [f"{places.mean() + 0.5:.1f}" for places in (columns, rows) if len(places)]
        sys.stdout.write(f"{' '.join((str(len(rows)), *middle))}\n")
        self._glfw.swap_buffers(window)


screen = FullScreen()
screen._glfw = _ReadingGlfw(screen)
screen.show((500.0, 30.0))
screen.show(None)
screen.close()

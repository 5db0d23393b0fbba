"""Fill a window with greys while somebody types, and print what it shows."""

import sys

import numpy as np

from visavis.cli.luminance_sheet import full_field
from visavis.lab.config import Screen
from visavis.stage.window import Window

SCREEN = Screen(
    width_m=0.3, height_m=0.2, width_px=320, height_px=240, distance_m=0.6, fullscreen=False
)
present = Window.present


def present_and_look(window: Window) -> None:
    raw = window.context.screen.read(components=3, alignment=1)
    looks.append(np.unique(np.frombuffer(raw, np.uint8).reshape(-1, 3), axis=0).tolist())
    present(window)


looks: list[object] = []
Window.present = present_and_look  # type: ignore[method-assign]  # what is about to be lit
with full_field(SCREEN) as ask:
    for rgb in ((0, 0, 0), (1, 1, 1), (51, 51, 51), (0, 186, 0), (255, 255, 255)):
        answer = ask(rgb, "> ")
        assert looks[-1] == [list(rgb)], (rgb, looks[-1])
        sys.stdout.write(f"typed {answer}\n")

"""Measure what a window that follows gaze adds to a frame: covered, and blurred.

    python -m benchmarks.gaze_window [--frames 60] [--json]

Own work is what Visavis does in a frame whose window moved, drawn so small that filling it counts
for nothing; filled is a picture of 1920 by 1080 pixels before a monitor, by the card or, without
one, by Mesa on the processor. Without a window the picture alone is drawn. Limit: 3 ms of own work.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.table import Row, show
from visavis.lab.clock import StopWatch
from visavis.lab.geometry import Pose, direction_from_yaw_pitch_deg
from visavis.lab.screen import FlatScreen, PlacedScreen
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import eye_camera
from visavis.stage.frame_truth import picture_crc32
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Grating
from visavis.stimuli.gaze_window import GazeWindow, WindowPlace
from visavis.stimuli.panels import Surface
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes.flat import DRESSED_BY, FlatScene

FULL_PX = (1920, 1080)
SMALL_PX = (64, 36)
LIMIT_MS = 3.0
HEAD = Pose(np.array([0.0, 1.2, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
SCREEN = FlatScreen(0.531, 0.299, *FULL_PX, 0.65)
WINDOWS = {
    "without a window": None,
    "covered around a window": GazeWindow(5.0),
    "blurred around a window": GazeWindow(5.0, 1.0, 0.625),
}


def frames_ms(renderer: Renderer, scene: FlatScene, target: EyeTarget, count: int) -> float:
    """Return the median time of so many frames, the window in another place in each."""
    camera, times_ms = eye_camera(HEAD, SCREEN.view_from(np.zeros(3))), []
    for k in range(count + 1):
        towards = direction_from_yaw_pitch_deg(np.array(0.1 * k), np.array(0.0))
        place = WindowPlace.of(k, HEAD.position_m, towards)
        watch = StopWatch()
        frame = SceneFrame(scene, k, np.zeros((0, 3)), np.zeros(0), window_at=place)
        picture = picture_of(frame)
        picture_crc32(picture)
        renderer.draw(picture, [camera], [target])
        renderer.context.finish()
        times_ms.append(1000 * watch.elapsed_s())
    return float(np.median(times_ms[1:]))  # the first compiles and sends


def main(argv: Sequence[str]) -> int:
    """Print the times; return 1 where the limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    scene = FlatScene(
        "flat",
        (),
        dressed_by=DRESSED_BY,
        items=(Grating(2.0),),
        head=HEAD,
        surface=Surface(PlacedScreen(SCREEN, HEAD)),
    )
    rows = []
    with Renderer(quality=Quality(samples=0)) as renderer:
        card = str(renderer.context.info["GL_RENDERER"])
        small, full = (EyeTarget(renderer.context, px, 0) for px in (SMALL_PX, FULL_PX))
        for name, window in WINDOWS.items():
            view = replace(scene, gaze_window=window)
            own_ms = frames_ms(renderer, view, small, options.frames)
            rows.append(Row(f"own work {name}", own_ms, "ms", LIMIT_MS))
            full_ms = frames_ms(renderer, view, full, max(3, options.frames // 4))
            rows.append(Row(f"filled {name}: {card}", full_ms, "ms"))
        small.release()
        full.release()
    return show(rows, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

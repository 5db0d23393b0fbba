"""Measure what light and shadows cost, in fills of the same targets.

    python -m benchmarks.fills [--eye-px WIDTH HEIGHT] [--json]

A fill draws one plain triangle over both eyes' targets, 4 samples a pixel, and makes them final.
The stare audience and the station's crowd are drawn for both eyes at the quality of graphics
cards, with shadow maps and without, each in turns with fills and in a process of its own, as Mesa
forgets shaders where there are many; medians, divided by the fill's. A card is waited for after
each; where a processor draws, CPU time of all threads is counted. Then what does not depend on
the computer: how often a pixel reads shadow maps, how many pixels are lit for each that is seen,
and what is drawn into maps, per stereo frame. "ratio" is how much better than the limit. Mesa's
driver for processors is spared anisotropic filters, which cost it more than all else together.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence

import moderngl
import numpy as np

from benchmarks.table import Row, show
from tests.stage.card_work import counted_work, reads_of_maps
from tests.stage.test_golden import audience, station
from visavis.lab.clock import SystemClock, cpu_time_s
from visavis.lab.geometry import Pose
from visavis.stage.card import textures
from visavis.stage.card.context import draws_on_processor
from visavis.stage.card.programs import compile_program
from visavis.stage.card.shaders.lighting import WHOLE_VERTEX
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.renderer import Quality, Renderer, Shadows
from visavis.stimuli.picture import Camera, Picture

EYE_PX = (480, 528)
SAMPLES, TURNS, WARMING = 4, 5, 2
MAX_FILLS = 3.0
MAX_READS = {"stare": 8.0, "crowd": 2.0}
MAX_LIT = 1.25
MAX_TRIANGLES = {"stare": 150_000.0, "crowd": 300_000.0}
PLAIN_FRAGMENT = "out vec4 pixel;\nvoid main() { pixel = vec4(0.2, 0.4, 0.6, 1.0); }\n"
SCENES = {"stare": audience, "crowd": station}
WITH_AND_WITHOUT: tuple[Shadows, ...] = ("maps", "none")
Size = tuple[int, int]


def both_eyes(name: str, size_px: Size) -> tuple[Picture, list[Camera]]:
    """Return a scene and the cameras of both eyes."""
    picture, camera = SCENES[name]()
    head = Pose(camera.pose.position_m, camera.pose.orientation_wxyz)
    return picture, [eye_camera(head, eye) for eye in default_views(size_px[0] / size_px[1])]


def times_ms(name: str, shadows: Shadows, size_px: Size) -> tuple[float, float]:
    """Return the medians of a fill and of a scene's frame, drawn in turns."""
    picture, cameras = both_eyes(name, size_px)
    clock, times = SystemClock(), []
    with Renderer(quality=Quality(samples=SAMPLES, shadows=shadows)) as renderer:
        context = renderer.context
        on_processor = draws_on_processor(context)
        if on_processor:
            textures.ANISOTROPY = 1.0
        targets = [EyeTarget(context, size_px, SAMPLES) for _ in cameras]
        fill = context.vertex_array(compile_program(context, WHOLE_VERTEX, PLAIN_FRAGMENT), [])

        def fill_both() -> None:
            for target in targets:
                target.begin((0.0, 0.0, 0.0))
                fill.render(moderngl.TRIANGLES, vertices=3)
                target.finish()

        def draw_both() -> None:
            renderer.draw(picture, cameras, targets)

        for _ in range(TURNS + WARMING):
            turn = []
            for job in (fill_both, draw_both):
                context.finish()
                t_ns, cpu_s = clock.now_ns(), cpu_time_s()
                job()
                context.finish()
                wall_ms, cpu_ms = (clock.now_ns() - t_ns) / 1e6, (cpu_time_s() - cpu_s) * 1e3
                turn.append(cpu_ms if on_processor else wall_ms)
            times.append(turn)
    fill_ms, frame_ms = np.median(times[WARMING:], axis=0)
    return float(fill_ms), float(frame_ms)


def _in_process(name: str, shadows: Shadows, size_px: Size) -> tuple[float, float]:
    task = [name, shadows, *map(str, size_px)]
    command = [sys.executable, "-m", "benchmarks.fills", "--task", *task]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    fill_ms, frame_ms = map(float, done.stdout.split())
    return fill_ms, frame_ms


def work_rows(name: str, size_px: Size) -> list[Row]:
    """Return what a steady stereo frame of a scene gives the card to do."""
    picture, cameras = both_eyes(name, size_px)
    reads = np.mean([reads_of_maps(picture, camera, size_px).mean() for camera in cameras])
    with Renderer(quality=Quality(samples=0)) as renderer:
        targets = [EyeTarget(renderer.context, size_px, 0) for _ in cameras]
        renderer.draw(picture, cameras, targets)
        with counted_work(renderer) as work:
            renderer.draw(picture, cameras, targets)
    pixels = 2 * size_px[0] * size_px[1]
    return [
        Row(f"{name}: reads of maps a pixel", float(reads), "reads", MAX_READS[name]),
        Row("  pixels lit for one that is seen", work.lit_px / pixels, "pixels", MAX_LIT),
        Row("  triangles into maps", work.map_triangles, "triangles", MAX_TRIANGLES[name]),
        Row("  pixels into maps and bounds", work.map_px, "pixels"),
    ]


def rows(size_px: Size) -> list[Row]:
    """Measure everything."""
    of_scenes, fills_ms = [], []
    for name in SCENES:
        for shadows in WITH_AND_WITHOUT:
            fill_ms, frame_ms = _in_process(name, shadows, size_px)
            fills_ms.append(fill_ms)
            with_maps = shadows == "maps"
            what = f"{name}, both eyes" if with_maps else "  without shadow maps"
            limit = MAX_FILLS if with_maps else None
            of_scenes.append(Row(what, frame_ms / fill_ms, "fills", limit))
    fill = Row("a fill of both eyes", float(np.median(fills_ms)), "ms")
    return [fill, *of_scenes, *(row for name in SCENES for row in work_rows(name, size_px))]


def main(argv: Sequence[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--eye-px", type=int, nargs=2, default=EYE_PX)
    parser.add_argument("--task", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.task:
        name, shadows, *size = arguments.task
        print(*times_ms(name, shadows, (int(size[0]), int(size[1]))))
        return 0
    width, height = arguments.eye_px
    return show(rows((width, height)), as_json=arguments.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

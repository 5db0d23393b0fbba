"""Measure drawing: the main thread's work per frame, off-screen frames per second, first frame.

    python -m benchmarks.stage [--json]

Main thread: Mesa's no-op driver takes every call and draws nothing, so what is left is Visavis:
posing and gaze of everybody, joint matrices, culling, levels of detail, both eyes submitted.
CPU time, median of many frames, of people who idle and shift their gaze; 12 at full detail, 150
by the usual rule. Off-screen: Mesa's processor driver, both eyes of 480 by 540 pixels, people at
their lightest, soft blobs for shadows, in a plain room; wall time, and CPU time of all threads.
First frame: from the start of the command to a whole image of twelve people, wall time. Draw
calls: those of a stereo frame of the stare audience and of the station's crowd, at full quality. On
a machine that does other work, wall times say little. "ratio" is how much better than the limit.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.table import Row, show
from visavis.lab.clock import SystemClock, cpu_time_s
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.levels import DetailRule
from visavis.stage.renderer import LIGHTEST, ON_PROCESSOR, Quality, Renderer
from visavis.stimuli.characters.cast import load_cast
from visavis.stimuli.characters.character import Material
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.gaze.gaze_plan import GazePlan, LookAt
from visavis.stimuli.motion.kinds import Idle, Talk
from visavis.stimuli.motion.people import PeopleMotion, Person
from visavis.stimuli.picture import Light, Picture, Prop, Room
from visavis.stimuli.rooms.solids import box

EYE_PX = (480, 540)
HEAD = Pose(np.array([0.0, 1.6, 0.6]), quat_from_yaw_pitch_deg(0.0))
FULL = Quality(detail=DetailRule(faces_px=(0.0,), budget_triangles=None))


def plain_room() -> Room:
    """Return floor and back wall under three lamps, one of which casts shadows."""
    floor = box((0, -0.05, -6), (16, 0.1, 16), (150, 146, 140))
    wall = box((0, 1.5, -14), (16, 3.0, 0.1), (196, 194, 188))
    paint = Material("paint", "other", 0.9)
    return Room(
        "plain",
        (Prop("floor", floor, paint, casts_shadow=False), Prop("wall", wall, paint)),
        (
            Light("spot", np.array([6.0, 5.8, 5.4]), np.array([1.2, 3.4, 1.5]),
                  np.array([-0.3, -0.75, -1.0]), 55.0, casts_shadow=True),
            Light("point", np.array([0.8, 0.85, 1.0]), np.array([-2.0, 2.4, 1.0])),
            Light("sun", np.full(3, 0.3), direction=np.array([0.2, -1.0, -0.4])),
        ),
        np.array([0.34, 0.35, 0.37]),
        np.array([0.18, 0.16, 0.14]),
    )  # fmt: skip


def crowd(count: int) -> Callable[[float], Picture]:
    """Return people in rows who idle or talk and shift their gaze, as pictures of time."""
    shipped = load_cast()
    cast = tuple(shipped[i % len(shipped)] for i in range(count))
    across = 6 if count <= 12 else 15
    people = tuple(
        Person(
            build_of(character),
            Talk() if i % 3 == 0 else Idle(),
            i,
            (0.72 * (i % across - (across - 1) / 2), 0.0, -0.9 - 0.85 * (i // across)),
            180.0,
        )
        for i, character in enumerate(cast)
    )
    motion, room = PeopleMotion(people), plain_room()
    plan = GazePlan.of(
        count,
        {
            i: [LookAt(0.0, "observer"), LookAt(1.0 + 0.01 * i, "person", ((i + 1) % count,))]
            for i in range(count)
        },
    ).watched_from(HEAD.position_m)

    def at(t_s: float) -> Picture:
        return Picture(round(t_s * 1e9), room, cast, motion.at(t_s, plan))

    return at


def frames_of(count: int, quality: Quality, n: int, *, read: bool) -> tuple[float, float]:
    """Return medians of wall and CPU milliseconds per stereo frame."""
    clock, at = SystemClock(), crowd(count)
    renderer = Renderer(quality=quality)
    cameras = [eye_camera(HEAD, eye) for eye in default_views(EYE_PX[0] / EYE_PX[1])]
    targets = [EyeTarget(renderer.context, EYE_PX, quality.samples) for _ in cameras]
    wall, cpu = [], []
    for i in range(n + 3):
        t_ns, cpu_s = clock.now_ns(), cpu_time_s()
        renderer.draw(at(2.0 + i / 90), cameras, targets)
        if read:
            renderer.context.finish()
        wall.append((clock.now_ns() - t_ns) / 1e6)
        cpu.append((cpu_time_s() - cpu_s) * 1e3)
    return float(np.median(wall[3:])), float(np.median(cpu[3:]))


def _in_process(task: str, environment: dict[str, str]) -> list[float]:
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.stage", "--task", task],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return [float(word) for word in done.stdout.split()]


def _perform(task: str) -> tuple[float, ...]:
    if task == "work":
        few = frames_of(12, FULL, 200, read=False)[1]
        return few, frames_of(150, replace(Quality(), samples=4), 200, read=False)[1]
    if task == "calls":
        # What counts calls belongs to the tests: no command that shows a frame loads it.
        from tests.stage.gl_counts import of_studies

        asked = of_studies()
        steady = (asked["stare"][1], asked["crowd"][1])
        return tuple(float(counts[k]) for counts in steady for k in ("draws", "binds"))
    if task == "offscreen":
        sizes = ((12, LIGHTEST, 40), (150, LIGHTEST, 20), (12, ON_PROCESSOR, 40))
        return tuple(ms for n, q, times in sizes for ms in frames_of(n, q, times, read=True))
    with Renderer(quality=LIGHTEST) as renderer:
        camera = eye_camera(HEAD, default_views()[0])
        return (float(renderer.image(crowd(12)(0.0), camera, EYE_PX).mean()),)


def rows() -> list[Row]:
    """Measure everything."""
    few, many = _in_process("work", {"GALLIUM_NOOP": "1"})
    wall_few, cpu_few, wall_many, cpu_many, wall_shown, _ = _in_process("offscreen", {})
    calls = _in_process("calls", {"GALLIUM_NOOP": "1"})
    clock = SystemClock()
    t_ns = clock.now_ns()
    _in_process("first", {})
    first_s = (clock.now_ns() - t_ns) / 1e9
    return [
        Row("main thread, 12 people at full detail", few, "ms", 0.8),
        Row("main thread, 150 people", many, "ms", 2.0),
        Row("draw calls, stare, stereo", calls[0], "calls", 33.0),
        Row("  textures bound", calls[1], "calls", 33.0),
        Row("draw calls, crowd, stereo", calls[2], "calls", 40.0),
        Row("  textures bound", calls[3], "calls", 40.0),
        Row("off-screen, 12 people, stereo", 1e3 / wall_few, "frames/s", 60.0, at_least=True),
        Row("  its CPU time, all threads", cpu_few, "ms", 50.0),
        Row("off-screen, 150 people, stereo", 1e3 / wall_many, "frames/s", 16.0, at_least=True),
        Row("  its CPU time, all threads", cpu_many, "ms", 250.0),
        Row("  12 people, the near ones finer", 1e3 / wall_shown, "frames/s", 40.0, at_least=True),
        Row("first frame after the command", first_s, "s", 1.8),
    ]


def main(argv: Sequence[str]) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument(
        "--task", choices=["work", "calls", "offscreen", "first"], help=argparse.SUPPRESS
    )
    arguments = parser.parse_args(argv)
    if arguments.task:
        print(*_perform(arguments.task))
        return 0
    return show(rows(), as_json=arguments.json)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

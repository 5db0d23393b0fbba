"""Measure visual motion warping: renders, control steps, how soon targets are met.

    python -m benchmarks.warping [--cases NAME ...] [--clips] [--json]

The floor of the renders is a loop that only places what a probe moves and fills its triangles.
A control step over all 22 units draws 45 poses at 128 × 128 and measures three features of each.
Steps of one core are counted in CPU time, so that other work on the machine does not matter; those
of two cores in the least wall time of many. The load of 4 000 triangles is a sample of those of
the 6 000-triangle level of a character, the latter being given beside it. "Ratio" is limit /
value, or value / limit where more is better. Targets of the presets are met when what is left is
a tenth of the wanted change or within what the buffer can tell; a preset holds when nine tenths
of its reachable poses are met in five steps. What the loop costs the frames that it runs beside is
measured by `benchmarks.waving_loop`.

`--clips` warps the presets' whole clips instead (a quarter of a minute each) and prints what is
reached, the largest offset, by how much joint limits are exceeded, and how fast and jerkily the
joints that were moved turn beside the same joints of the original. `--cases` chooses presets.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.stimuli.warping.smoothness import peak_turning
from visavis.lab.clock import StopWatch, cpu_time_s
from visavis.lab.compiled import compiled
from visavis.lab.geometry import Vector
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.joint_limits import beyond_deg
from visavis.stimuli.motion.warping.cases import CASES, StagedCase, case_named, stage_case
from visavis.stimuli.motion.warping.clips import warp_clip
from visavis.stimuli.motion.warping.control import (
    ControlSettings,
    Outcome,
    Situation,
    control_step,
    damped_solution,
    probes_of,
    scale_of,
    see,
    steer,
    wanted_features,
    warped_turns,
)
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.outlook import outlook
from visavis.stimuli.motion.warping.perceived import (
    SeenBody,
    body_of,
    matrices_of,
    perceived_parts,
    poses_alike,
)
from visavis.stimuli.motion.warping.raster_kernels import (
    Bytes,
    Floats,
    Moving,
    Posed,
    Skin,
    pixels_of,
    project_some,
    skin_some,
)
from visavis.stimuli.motion.warping.units import WarpingUnit, units_named

Row = dict[str, Any]
SIZE_PX = 128
ENOUGH_01 = 0.9
LIVELIER, STILL_JERK_DEG_S3 = 1.5, 5_000.0
"""The jerk of a warped motion is at most so many times that of its original, or, where that hardly
moves, a tenth of what a wave has."""
LONG_RUNS: tuple[dict[str, Any], ...] = (
    {},
    {"step_cap_deg": 5.0},
    {"probe_deg": 6.0},
    {"probe_deg": 2.0, "wide_probe_deg": 24.0},
    {"error_cap": 1.0, "step_cap_deg": 15.0},
)
"""Settings that try for 60 steps what five did not reach."""
FILL = "what moves placed, its triangles filled without depth, light and measures"
ONE_CORE_HZ, TWO_CORES_HZ = 60.0, 100.0
TARGETS = (
    FeatureTarget("coverage", ("face", "hands"), 0.25),
    FeatureTarget("horizontal_extension", ("arms",), 0.1),
    FeatureTarget("vertical_extension", ("arms",), 0.0),
)


def row(
    name: str, value: float, unit: str, limit: float | None = None, *, more: bool = True
) -> Row:
    """Return one line of the table; `more` says that more is better."""
    ratio = None
    if limit is not None and (more or value > 0):
        ratio = float(f"{(value / limit if more else limit / value):.3g}")
    return {
        "name": name,
        "value": float(f"{value:.3g}"),
        "unit": unit,
        "limit": limit,
        "ratio": ratio,
    }


def least_s(call: Callable[[], object], now_s: Callable[[], float], rounds: int = 60) -> float:
    """Return the least seconds of one call by a clock."""
    call()
    best = np.inf
    for _ in range(rounds):
        began_s = now_s()
        call()
        best = min(best, now_s() - began_s)
    return float(best)


def sampled_body(body: SeenBody, count: int) -> SeenBody:
    """Return a body with so many of its triangles, chosen evenly."""
    kept = np.linspace(0, len(body.triangles) - 1, count).astype(int)
    return replace(body, triangles=body.triangles[kept], labels=body.labels[kept])


def situation_of(stage: StagedCase, body: SeenBody) -> Situation:
    """Return a moment of a case with all units and three features."""
    pose = stage.clip.at(0.7)
    view = outlook(stage.view.camera, SIZE_PX)
    return Situation(body, view, TARGETS, units_named(("all",)), pose.root_m, pose.orientation_wxyz)


@compiled
def fill_moving(
    skin: Skin,
    moving: Moving,
    first: Posed,
    matrices: Floats,
    rows: npt.NDArray[np.int64],
    eye: Floats,
    ids: Bytes,
    filled: npt.NDArray[np.int64],
) -> None:
    """Place what moves in some poses (n, j, 3, 4) and fill its triangles' pixels in ids (n, h, w)
    with 1, without depth, light or anything that is still; count triangles gone through in `filled`
    (1,).
    """
    height, width = ids.shape[1:]
    points, screen = first.points.copy(), first.screen.copy()
    for k in rows:
        skin_some(moving.vertices, skin, matrices[k], points)
        project_some(moving.vertices, points, eye, width, height, screen)
        for t in range(moving.faces.triangles.shape[0]):
            filled[0] += 1
            ia, ib, ic = moving.faces.triangles[t]
            xa, ya, xb, yb = screen[ia, 0], screen[ia, 1], screen[ib, 0], screen[ib, 1]
            xc, yc = screen[ic, 0], screen[ic, 1]
            if (xc - xa) * (yb - ya) - (xb - xa) * (yc - ya) <= 0.0:
                continue
            c0, c1, r0, r1 = pixels_of(xa, ya, xb, yb, xc, yc, width, height)
            for r in range(r0, r1 + 1):
                y, is_inside = r + 0.5, False
                for c in range(c0, c1 + 1):
                    x = c + 0.5
                    ea = (xc - xb) * (y - yb) - (yc - yb) * (x - xb)
                    eb = (xa - xc) * (y - yc) - (ya - yc) * (x - xc)
                    ec = (xb - xa) * (y - ya) - (yb - ya) * (x - xa)
                    if ea <= 0.0 and eb <= 0.0 and ec <= 0.0:
                        ids[k, r, c], is_inside = 1, True
                    elif is_inside:
                        break


def fill_all(moment: Situation, probes: Vector) -> tuple[Bytes, int]:
    """Fill what moves in all poses under offsets (n, w); return ids and how many triangles that
    were.
    """
    body, view = moment.body, moment.view
    turns = warped_turns(body.skeleton, moment.units, moment.local_wxyz, probes)
    roots = np.broadcast_to(moment.root_m, (len(turns), 3))
    matrices = matrices_of(body.skeleton, roots, turns)
    first = body.first_in(view, matrices[0])
    ids = np.zeros((len(matrices), *view.size_px), np.uint8)
    filled = np.zeros(1, np.int64)
    for moving, rows in poses_alike(body, matrices):
        fill_moving(body.skin, moving, first, matrices, rows, view.eye, ids, filled)
    return ids, int(filled[0])


def steps(stage: StagedCase) -> list[Row]:
    """Control steps a second, and what they consist of."""
    rows: list[Row] = []
    level = body_of(stage.character)
    for body in (sampled_body(level, 4000), level):
        rows += _steps_of(situation_of(stage, body))
    jacobian = np.random.default_rng(1).normal(size=(3, 22))
    solve_s = least_s(lambda: damped_solution(jacobian, np.ones(3), 0.2), StopWatch().elapsed_s)
    rows.append(row("one damped solution", solve_s * 1e6, "µs"))
    return rows


def _steps_of(moment: Situation) -> list[Row]:
    n, body = len(moment.units), moment.body
    original = see(moment, np.zeros((1, n)))[0]
    wanted, scale = wanted_features(TARGETS, original), scale_of(moment, original)
    one, two, omega = ControlSettings(), ControlSettings(threads=2), np.full(n, 0.05)
    one_s = least_s(lambda: control_step(moment, omega, wanted, scale, one), cpu_time_s)
    with ThreadPoolExecutor(2) as pool:
        two_s = least_s(
            lambda: control_step(moment, omega, wanted, scale, two, pool),
            StopWatch().elapsed_s,
            200,
        )
    roots = np.repeat(moment.root_m[None], 45, axis=0)
    turns = np.repeat(moment.local_wxyz[None], 45, axis=0)
    turns[:, 0] = np.array([[np.cos(a), 0, np.sin(a), 0] for a in np.linspace(0, 0.1, 45)])
    all_s = least_s(lambda: perceived_parts(body, moment.view, roots, turns), cpu_time_s, 20)
    count = f"{len(body.triangles)} triangles"
    probes = np.concatenate([np.zeros((1, n)), probes_of(moment, one.probe_deg)]) + omega
    fill_s = least_s(lambda: fill_all(moment, probes), cpu_time_s)
    return [
        row(f"control steps, one core, {count}", 1 / one_s, "1/s", ONE_CORE_HZ),
        row(f"control steps, two cores, {count}", 1 / two_s, "1/s", TWO_CORES_HZ),
        row(f"renders in them, one core, {count}", (2 * n + 1) / one_s, "1/s")
        | {"floor": (2 * n + 1) / fill_s, "floor_name": FILL},
        row(f"renders of poses that share nothing, {count}", 45 / all_s, "1/s"),
    ]


def presets(names: Sequence[str], moments: int = 10) -> list[Row]:
    """How many poses come within 10 % of the target in five steps, per preset, of the reachable.

    A pose counts as reachable when any of `LONG_RUNS` reaches it from rest; of those that none
    reaches, the best share of the wanted change is given; of those that take more steps, the
    largest offset and that of the trunk. Of all that are missed it is counted how many want more
    coverage than the resting pose has with nothing in between and all in light.
    """
    who = load_character("anna")
    rows: list[Row] = []
    for case in map(case_named, names):
        stage = stage_case(case, who)
        met, reachable, best, missed, late = 0, 0, [], [], []
        for t_s in np.linspace(0.05, 0.95, moments) * stage.clip.duration_s:
            pose = stage.clip.at(t_s)
            moment = Situation(
                stage.body,
                stage.view,
                case.targets,
                stage.units,
                pose.root_m,
                pose.orientation_wxyz,
            )
            found = steer(moment, replace(case.settings, most_steps=5))
            if found.is_reached:
                met, reachable = met + 1, reachable + 1
                continue
            missed.append(_wants_more_than_there_is(moment, found))
            shares = []
            for long_run in LONG_RUNS:
                found = steer(moment, replace(case.settings, most_steps=60, **long_run))
                shares.append(_least_share(found))
                if found.is_reached:
                    reachable += 1
                    late.append(_offsets_deg(stage.units, found))
                    break
            else:
                best.append(max(shares))
        rows.append(
            row(
                f"{case.name}: poses within 10 % in 5 steps, of {moments}",
                met,
                "poses",
                math.ceil(ENOUGH_01 * reachable),
            )
            | {"reachable": reachable}
        )
        if missed:
            said = f"of {len(missed)} missed, want more than there is with nothing in between"
            rows.append(row(f"{case.name}: {said}", sum(missed), "poses"))
        if late:
            said = f"{len(late)} reached later, largest offset"
            largest, trunk = np.array(late).max(axis=0)
            rows.append(row(f"{case.name}: {said} (of the spine {trunk:.3g})", largest, "°"))
        if best:
            said = "unreachable, best share of the wanted change in 60 steps"
            rows.append(
                row(f"{case.name}: {said} ({len(best)} poses, median)", float(np.median(best)), "1")
            )
    return rows


def _offsets_deg(units: tuple[WarpingUnit, ...], found: Outcome) -> tuple[float, float]:
    """Return the largest offset of all units, and of those of the spine."""
    degrees = np.abs(np.degrees(found.omega_rad))
    spine = [a for a, unit in zip(degrees, units, strict=True) if unit.name.startswith("spine")]
    return float(degrees.max()), float(max(spine, default=0.0))


def _wants_more_than_there_is(moment: Situation, found: Outcome) -> bool:
    """Tell whether a coverage is wanted that the resting pose lacks even in the open."""
    bare = replace(moment, view=outlook(moment.view.camera, moment.view.size_px[1]))
    there_is = see(bare, np.zeros((1, len(moment.units))))[0]
    covers = np.array([t.kind == "coverage" for t in moment.targets])
    return bool((covers & (found.goal > there_is)).any())


def clips(names: Sequence[str]) -> list[Row]:
    """What whole warped clips reach, and how smoothly, per preset."""
    who = load_character("anna")
    rows: list[Row] = []
    for case in map(case_named, names):
        stage = stage_case(case, who)
        found = warp_clip(
            stage.clip, stage.body, stage.view, case.targets, stage.units, case.settings
        )
        turned = (found.clip.orientation_wxyz != stage.clip.orientation_wxyz).any(axis=-1)
        moved = tuple(np.array(found.clip.skeleton.names)[turned.any(axis=0)])
        past = float(beyond_deg(found.clip.orientation_wxyz)[turned].max(initial=0.0))
        before, after = (peak_turning(clip, moved) for clip in (stage.clip, found.clip))
        said = f"{case.name}, clip: "
        rows += [
            row(said + "poses solved one by one", 100 * float(found.pose_reached.mean()), "%"),
            row(said + "frames reached", 100 * float(found.is_reached.mean()), "%"),
            row(said + "largest offset", float(np.degrees(np.abs(found.omega_rad).max())), "°"),
            row(said + "beyond joint limits", past, "°"),
            row(said + f"peak speed (original {before.speed_deg_s:.3g})", after.speed_deg_s, "°/s"),
            row(
                said + f"peak acceleration (original {before.acceleration_deg_s2:.3g})",
                after.acceleration_deg_s2,
                "°/s²",
            ),
            row(
                said + f"peak jerk (original {before.jerk_deg_s3:.3g})",
                after.jerk_deg_s3,
                "°/s³",
                round(max(LIVELIER * before.jerk_deg_s3, STILL_JERK_DEG_S3)),
                more=False,
            ),
        ]
    return rows


def _least_share(found: Outcome) -> float:
    """Return how much of the wanted change was reached, of the feature that came least far."""
    wanted = found.goal - found.original
    changes = np.abs(wanted) > 0
    if not changes.any():
        return 1.0
    return float(((found.final - found.original)[changes] / wanted[changes]).min())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description="Measure visual motion warping.")
    parser.add_argument("--cases", nargs="+", choices=tuple(CASES), default=tuple(CASES))
    parser.add_argument("--clips", action="store_true")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args(arguments)
    if chosen.clips:
        rows = clips(chosen.cases)
    else:
        stage = stage_case(case_named("view_change"), load_character("anna"))
        rows = [*steps(stage), *presets(chosen.cases)]
    if chosen.json:
        json.dump(rows, sys.stdout, indent=2)
        print()
    else:
        for r in rows:
            limit = "" if r["limit"] is None else f"limit {r['limit']:<6} ratio {r['ratio']}"
            print(f"{r['name']:<72} {r['value']:>9} {r['unit']:<5} {limit}")
            if "floor" in r:
                print(f"    {r['floor_name']}: {r['floor']:.0f} {r['unit']}")
    return 1 if any(r["ratio"] is not None and r["ratio"] < 1 for r in rows) else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Measure the warping loop of the waving study: frames on target, its rate, its cost to frames.

    python -m benchmarks.waving_loop [--waves 15] [--frames 6] [--looks 1500] [--seconds 10]
    python -m benchmarks.waving_loop --waves 0            the loop beside frames alone
    python -m benchmarks.waving_loop --frames 0           without brute force, which takes minutes

For waves at every place: the share of frames on target and within reach, as every trial tells
them; then `--frames` of each, at any time, by brute force (a cross-entropy search over all units,
`--looks` poses a frame) from the front and from the turned wave, and the share on target among
frames that either came to. For eyes above and below the planned height: with the plan alone, and
with the loop.
Last, frames at 90 Hz with the loop in a process of its own beside them, and without it.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from visavis.experiments.waving.clips import (
    DEFAULT_MAKING,
    WARPING,
    Making,
    reached_in,
    situation_of,
    solved_key,
    study_wave,
)
from visavis.lab.clock import NS_PER_S, StopWatch, SystemClock
from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.office import agents_of, office_picture
from visavis.stimuli.dressing.office_view import eye_at
from visavis.stimuli.motion.warping.control import (
    Situation,
    is_within,
    see,
    tolerance_of,
    wanted_features,
)
from visavis.stimuli.motion.warping.track import TrackLoop
from visavis.stimuli.scenes.office import (
    CLERKS,
    CUSTOMERS,
    STANDING_EYE_M,
    OfficeFrame,
    OfficeScene,
)
from visavis.study.background import BackgroundExecutor, InlineExecutor

FRAME_S = 1 / 90
ON_TARGET_01, RATE_HZ, P99_MS = 0.8, 20.0, 11.0
OFF_M = (-0.2, -0.1, 0.1, 0.2)
BATCH, ELITE = 100, 15
About = tuple[str, str, Making]


def reachable(situation: Situation, looks: int, rng: np.random.Generator) -> bool:
    """Search all offsets of one pose by cross-entropy; tell whether any meets both targets."""
    reach = np.radians([unit.range_deg for unit in situation.units])
    original = see(situation, np.zeros((1, len(reach))))[0]
    if not original.all():
        return False
    wanted = wanted_features(situation.targets, original)
    tolerance = tolerance_of(situation, original, wanted)
    middle, spread = np.zeros(len(reach)), 0.5 * reach
    for _ in range(max(1, looks // BATCH)):
        tried = middle + spread * rng.standard_normal((BATCH, len(reach)))
        tried = np.clip(tried, -reach, reach)
        off = (np.abs(wanted - see(situation, tried)) / tolerance).max(axis=1)
        order = np.argsort(off)
        if off[order[0]] <= 1.0:
            return True
        best = tried[order[:ELITE]]
        middle, spread = best.mean(axis=0), best.std(axis=0) + 0.01 * reach
    return False


def wave_rows(waves: int, frames: int, looks: int) -> list[dict[str, object]]:
    """Return what planned waves come to, and what brute force says can be come to."""
    every = [(c.name, p.name) for c in CLERKS for p in CUSTOMERS]
    # The same share of every clerk and place where not all are wanted.
    chosen = [every[i] for i in np.linspace(0, len(every) - 1, waves).round().astype(int)]
    rng, rows, counted = np.random.default_rng(1), [], np.zeros((0, 3), dtype=bool)
    planned = []
    for clerk, place in chosen:
        wave = study_wave(clerk, place, WARPING)
        track, eye_m, bare = wave.waving.warp, eye_at(place), replace(wave.waving, warp=None)
        if wave.plan_result is None or track is None:
            continue
        planned.append((wave.plan_result.met_01, wave.plan_result.reachable_01))
        rows.append(
            {
                "name": f"{clerk} at {place}: frames on target",
                "value": wave.plan_result.met_01,
                "beside": "within reach of the planning search "
                f"{wave.plan_result.reachable_01:.2f}",
            }
        )
        turned = study_wave(
            clerk, place, WARPING, replace(DEFAULT_MAKING, warp_from="oriented", increment=0.0)
        ).waving
        # At any time: frames on keys are better than those between them.
        for t_s in rng.uniform(bare.start_s, bare.end_s, frames):
            front, side = (
                situation_of(w, place, eye_m, float(t_s), DEFAULT_MAKING.increment)
                for w in (bare, turned)
            )
            original, now = see(front, np.stack([np.zeros(len(track.units)), track.at(t_s)]))
            met = bool(original.all()) and is_within(
                wanted_features(front.targets, original), original, now, front
            )
            found = [met, met or reachable(front, looks, rng), reachable(side, looks, rng)]
            counted = np.vstack([counted, found])
    mean = np.mean(planned, axis=0)
    rows += [
        {"name": "all waves: frames on target", "value": float(mean[0])},
        {"name": "all waves: within reach of the planning search", "value": float(mean[1])},
        {
            "name": "on target for every frame within reach of that search",
            "value": float(mean[0] / mean[1]) if mean[1] else float("nan"),
            "beside": f"wanted {ON_TARGET_01}",
        },
    ]
    if not len(counted):
        return rows
    met, front_01, side_01 = counted.mean(axis=0)
    return [
        *rows,
        {"name": "brute force: within reach from the front", "value": float(front_01)},
        {"name": "brute force: within reach from the turned wave", "value": float(side_01)},
        {
            "name": "on target among frames within reach by brute force",
            "value": float(met / front_01) if front_01 else float("nan"),
            "beside": f"wanted {ON_TARGET_01}",
        },
    ]


def height_rows() -> list[dict[str, object]]:
    """Return frames on target for eyes off the planned height, by plan and by loop."""
    rows = []
    about: About = ("clerk_left", "place_3", DEFAULT_MAKING)
    for off_m in OFF_M:
        eye_m = eye_at("place_3", STANDING_EYE_M + off_m)
        plan, loop = (followed(about, eye_m, corrects=c) for c in (False, True))
        rows.append(
            {
                "name": f"eyes {off_m:+.1f} m: frames on target with the loop",
                "value": loop,
                "beside": f"by the plan alone {plan:.2f}",
            }
        )
    return rows


def followed(about: About, eye_m: Vector, *, corrects: bool) -> float:
    """Return the share of frames on target for eyes (3,), corrected frame by frame or not."""
    waving = study_wave(about[0], about[1], WARPING, about[2]).waving
    if waving.warp is None:
        return float("nan")
    loop = TrackLoop(waving.warp, partial(solved_key, about), InlineExecutor())
    for k in range(round(waving.end_s / FRAME_S) if corrects else 0):
        loop.step(k * FRAME_S, eye_m)
    times = np.arange(waving.start_s, waving.end_s, 0.05)
    omega = np.array([loop.track.at(float(t)) for t in times])
    return reached_in(about, times, omega, np.tile(eye_m, (len(times), 1))).met_01


def frame_rows(seconds: float) -> list[dict[str, object]]:
    """Return frame times of everybody's motion at 90 Hz, and the loop's rate beside it."""
    about: About = ("clerk_left", "place_3", DEFAULT_MAKING)
    waving = study_wave(*about[:2], WARPING, about[2]).waving
    scene = OfficeScene("office", agents_of("place_3", waving, 7, 0.0), waving=waving, seed=7)
    still = np.array([a.facing for a in scene.agents])
    clock, rows = SystemClock(), []
    round_s = waving.end_s
    beside = BackgroundExecutor()
    for corrects in (False, True):
        work_ms: list[float] = []
        taken = late = rounds = 0
        with beside.in_process():
            for _ in range(max(1, round(seconds / round_s)) + 1):
                loop = None
                if corrects and waving.warp is not None:
                    loop = TrackLoop(waving.warp, partial(solved_key, about), beside)
                found = _round(clock, scene, still, loop, round_s)
                if rounds:  # the first one starts the process
                    work_ms += found
                    taken += loop.n_taken if loop else 0
                    late += loop.late if loop else 0
                rounds += 1
        how = "with the loop beside" if corrects else "without the loop"
        rows += [
            {"name": f"frame work {how}, median (ms)", "value": float(np.median(work_ms))},
            {
                "name": f"frame work {how}, p99 (ms)",
                "value": float(np.quantile(work_ms, 0.99)),
                "beside": f"at most {P99_MS:g}",
            },
        ]
        if corrects:
            rate_hz = taken / ((rounds - 1) * DEFAULT_MAKING.wave_s)
            rows += [
                {"name": "corrections a second", "value": rate_hz, "beside": f"≥ {RATE_HZ:g}"},
                {"name": "corrections that came too late", "value": float(late)},
            ]
    return rows


def _round(
    clock: SystemClock, scene: OfficeScene, still: Vector, loop: TrackLoop | None, seconds: float
) -> list[float]:
    """Return the work of every frame of one wave in ms, the head swaying by centimetres."""
    begun_ns, work_ms = clock.now_ns(), []
    for k in range(round(seconds / FRAME_S)):
        clock.sleep_until_ns(begun_ns + round(k * FRAME_S * NS_PER_S))
        watch, t_s = StopWatch(), (clock.now_ns() - begun_ns) / NS_PER_S
        if loop is not None:
            sway = 0.02 * np.array([np.sin(1.3 * t_s), 0.2 * np.sin(2.1 * t_s), np.cos(t_s)])
            loop.step(t_s, eye_at("place_3") + np.round(sway, 2))
        warp = None if loop is None else loop.track
        office_picture(
            OfficeFrame(scene, round(t_s * NS_PER_S), still, np.ones(len(still)), warp=warp)
        )
        work_ms.append(watch.elapsed_s() * 1e3)
    return work_ms


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--waves", type=int, default=15)
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--looks", type=int, default=1500)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args(arguments)
    rows = frame_rows(given.seconds)
    if given.waves:
        rows += height_rows() + wave_rows(given.waves, given.frames, given.looks)
    if given.json:
        print(json.dumps(rows, indent=1))
        return 0
    for row in rows:
        print(f"{row['name']!s:<60} {row['value']:8.3f}  {row.get('beside', '')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

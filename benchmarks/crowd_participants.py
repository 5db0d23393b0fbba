"""Hold simulated participants of the crowd study against the published figures.

    python -m benchmarks.crowd_participants [--seeds 50] [--participants 23] [--processes 2]
                                            [--control-seeds 10] [--surfaces 0] [--keep FILE]
                                            [--json]

Over the quick path (`visavis.experiments.crowd.quick_study`). Prints mean and spread of every
measure beside the published ones, the limits of a quarter, the share of seeds in which each part of
the published pattern returns, and the same shares with the vibration disconnected. Studies done are
kept in FILE, one line each, and not simulated again; participants with other traits are.

The quick path measures capsules, which are stouter than the characters. With `--surfaces N` one
walk in each block of N people of the first seed is also measured on the characters' own surfaces,
as `visavis analyse` does and as the source did; it takes some 25 CPU seconds a person.
"""

import argparse
import json
import os
import sys
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import ttest_rel

from visavis.analysis.cells import dice
from visavis.analysis.gait import step_length_m
from visavis.experiments.crowd.collision_measures import collision_rows, walk_volumes
from visavis.experiments.crowd.design import AFTER, BEFORE, CONDITIONS, HAPTIC, CrowdParameters
from visavis.experiments.crowd.participant.participant import CrowdParticipant
from visavis.experiments.crowd.participant.traits import DEFAULT_POPULATION
from visavis.experiments.crowd.published import VOLUME_OF_CUBES as CUBES
from visavis.experiments.crowd.quick_measures import Cell, QuickWalk, quick_measures
from visavis.experiments.crowd.quick_study import REST_NS, block_walks, quick_walk
from visavis.experiments.crowd.quick_study import STEP_NS as QUICK_STEP_NS
from visavis.experiments.crowd.study import study
from visavis.experiments.crowd.walks import STEP_NS, Walk
from visavis.lab.body_joints import BODY_JOINTS
from visavis.lab.clock import NS_PER_S, StopWatch
from visavis.lab.geometry import Vector
from visavis.protocol.plan.parameters import known_of
from visavis.protocol.plan.session_plan import Trial
from visavis.results.printed_orders import MIN_HOLDS_01, printed_orders_of
from visavis.study.expectations import orders_of
from visavis.study.experiment import StudyExperiment

PUBLISHED = {
    "collisions": ((71.0, 62.8, 60.7), (29.2, 34.6, 34.6)),
    CUBES: ((0.8, 0.6, None), (0.3, 0.3, None)),
    "shoulders_to_gap_deg": ((34.3, 40.1, 38.7), (6.0, 8.2, 3.7)),
    "speed_m_s": ((0.43, 0.40, 0.42), (0.07, 0.07, 0.07)),
}
"""Means and standard deviations over participants by block (Berton et al. 2020).

Volumes are those of cubes that touch both bodies, as the source counts them.
"""
COMMON_VOLUME = "max_volume_dm3"
"""The true common volume, which the study tests; no mean of it is printed."""
DICE = {
    (BEFORE, HAPTIC): 0.847,
    (HAPTIC, AFTER): 0.886,
    (BEFORE, AFTER): 0.859,
    "within": 0.812,
}
LIMIT_01 = 0.25
SPLITS = 30
PATTERN = tuple(
    (f"{order.measure}: {greater} > {less}", order.measure, less, greater)
    for order in printed_orders_of(StudyExperiment(study))
    for greater, less in orders_of(order.order, order.name)[0].pairs
)
"""The orders that the source states (`visavis fidelity crowd`), two blocks at a time."""
SAME_PATHS = "paths between blocks as alike as within"
SAME_WITHIN = 0.02
"""Paths are no different where blocks are at most this much less alike than halves of one."""


@dataclass(frozen=True)
class SeedOutcome:
    """One simulated study: means and spreads by measure and block, Dice, p by part of pattern."""

    seed: int
    mean: dict[str, tuple[float, ...]]
    sd: dict[str, tuple[float, ...]]
    dice: dict[str, float]
    holds: dict[str, bool]
    significant: dict[str, bool]
    home_01: float


@dataclass(frozen=True)
class QuickStudy:
    """One simulated study: `trials` one row per walk; `cells` the cells each walk visited."""

    trials: pd.DataFrame
    cells: list[frozenset[Cell]]


def quick_study(
    participants: int,
    seed: int,
    *,
    effect: bool = True,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> QuickStudy:
    """Simulate and measure a study; `effect=False` disconnects the vibration."""
    experiment = StudyExperiment(study, parameters)
    params = known_of(CrowdParameters, experiment.parameters)
    rows: list[dict[str, Any]] = []
    cells: list[frozenset[Cell]] = []
    for index in range(participants):
        plan = experiment.plan(index, seed)
        for block in block_walks(CrowdParticipant(index, seed, effect), plan, params):
            for trial, row, visited in block:
                which = {"participant": index, "group": plan.group, "trial_id": trial.trial_id}
                rows.append({**which, **trial.factors, **row})
                cells.append(visited)
    return QuickStudy(pd.DataFrame(rows), cells)


def block_means(trials: pd.DataFrame, measures: Sequence[str]) -> pd.DataFrame:
    """Return means over participants of their block means, one row per condition."""
    per_person = trials.groupby(["condition", "participant"])[list(measures)].mean()
    means: pd.DataFrame = per_person.groupby("condition").mean()
    return means


def simulate_seed(seed: int, *, participants: int, effect: bool) -> SeedOutcome:
    """Simulate and measure one study."""
    simulated = quick_study(participants, seed, effect=effect)
    trials = simulated.trials
    measures = [*PUBLISHED, COMMON_VOLUME]
    means = block_means(trials, measures).loc[list(CONDITIONS)]
    people = {
        condition: of_block.groupby("participant")[measures].mean()
        for condition, of_block in trials.groupby("condition")
    }
    similar = path_similarity(simulated, seed)
    holds, significant = {}, {}
    for name, measure, first, second in PATTERN:
        before, now = (people[c][measure].to_numpy(np.float64) for c in (first, second))
        holds[name] = bool((now - before).mean() > 0)
        significant[name] = holds[name] and bool(3 * ttest_rel(now, before).pvalue < 0.05)
    between = np.mean([v for k, v in similar.items() if k != "within"])
    holds[SAME_PATHS] = significant[SAME_PATHS] = bool(between > similar["within"] - SAME_WITHIN)
    return SeedOutcome(
        seed,
        {m: tuple(means[m]) for m in measures},
        {m: tuple(float(people[c][m].std()) for c in CONDITIONS) for m in measures},
        similar,
        holds,
        significant,
        float(trials["came_back"].mean()),
    )


def path_similarity(study: QuickStudy, seed: int) -> dict[str, float]:
    """Return Dice of the cells of everybody, between blocks and within (random halves)."""
    trials = study.trials.reset_index(drop=True)
    rng = np.random.default_rng(seed)
    found: dict[str, list[float]] = {}
    for _, of_crowd in trials.groupby("configuration"):
        sets = {
            condition: [study.cells[i] for i in of_crowd.index[of_crowd["condition"] == condition]]
            for condition in CONDITIONS
        }
        union = {c: frozenset().union(*some) for c, some in sets.items()}
        for pair in ((BEFORE, HAPTIC), (HAPTIC, AFTER), (BEFORE, AFTER)):
            found.setdefault(" ".join(pair), []).append(dice(union[pair[0]], union[pair[1]]))
        for some in sets.values():
            for _ in range(SPLITS):
                order = rng.permutation(len(some))
                half = len(some) // 2
                one, other = (
                    frozenset().union(*(some[i] for i in part))
                    for part in (order[:half], order[half:])
                )
                found.setdefault("within", []).append(dice(one, other))
    return {name: float(np.mean(values)) for name, values in found.items()}


def simulate_studies(
    seeds: Sequence[int], participants: int, processes: int, *, effect: bool, keep: Path | None
) -> list[SeedOutcome]:
    """Simulate studies side by side, at low priority; the order of `seeds` is kept.

    With `keep`, studies found there are not simulated again, and new ones are added as they come.
    """
    kind = f"{zlib.crc32(repr((DEFAULT_POPULATION, participants, effect, PUBLISHED)).encode()):08x}"
    done = {} if keep is None else _kept(keep, kind)
    one = partial(simulate_seed, participants=participants, effect=effect)
    watch = StopWatch()
    label = "with" if effect else "without"
    with ProcessPoolExecutor(processes, get_context("spawn"), _yield_to_others) as pool:
        running = {pool.submit(one, seed): seed for seed in seeds if seed not in done}
        for future in as_completed(running):
            outcome = future.result()
            done[outcome.seed] = outcome
            if keep is not None:
                with keep.open("a", encoding="utf-8") as lines:
                    lines.write(json.dumps({"kind": kind, **asdict(outcome)}) + "\n")
            mean, sd = outcome.mean["collisions"], outcome.sd["collisions"]
            print(
                f"{label} vibration, seed {outcome.seed}: collisions "
                + ", ".join(f"{m:.1f} ({s:.1f})" for m, s in zip(mean, sd, strict=True))
                + f"; {sum(seed in done for seed in seeds)} of {len(seeds)} studies, "
                f"{watch.elapsed_s():.0f} s",
                file=sys.stderr,
                flush=True,
            )
    return [done[seed] for seed in seeds]


def _kept(keep: Path, kind: str) -> dict[int, SeedOutcome]:
    if not keep.exists():
        return {}
    found = {}
    for line in keep.read_text(encoding="utf-8").splitlines():
        raw = json.loads(line)
        if raw.pop("kind") == kind:
            for part in ("mean", "sd"):
                raw[part] = {name: tuple(values) for name, values in raw[part].items()}
            found[raw["seed"]] = SeedOutcome(**raw)
    return found


def _yield_to_others() -> None:
    os.nice(max(10 - os.nice(0), 0))


def surface_rows(people: int, seed: int) -> list[dict[str, object]]:
    """Measure one walk of every block of each person on characters' surfaces and on capsules.

    Returns one row per block: means over people of collisions and of the largest volume of a
    collision in dm³ by the source's rule, both ways, beside what is printed.
    """
    experiment = StudyExperiment(study)
    params = known_of(CrowdParameters, experiment.parameters)
    rows: list[dict[str, Any]] = []
    for index in range(people):
        participant = CrowdParticipant(index, seed)
        now_ns = 0
        for block in experiment.plan(index, seed).blocks:
            for number, trial in enumerate(block.trials):
                quick = quick_walk(participant, trial, now_ns, params)
                if not trial.is_practice and number == index % len(block.trials):
                    rows.append(_both_ways(participant, trial, quick, now_ns))
                now_ns += len(quick.t_s) * QUICK_STEP_NS + REST_NS
    means = pd.DataFrame(rows).groupby("condition").mean().loc[list(CONDITIONS)]
    printed = PUBLISHED[CUBES][0]
    return [
        {
            "block": block,
            "published": printed[k],
            **{str(n): x for n, x in means.loc[block].items()},
        }
        for k, block in enumerate(CONDITIONS)
    ]


def _both_ways(
    participant: CrowdParticipant, trial: Trial, quick: QuickWalk, start_ns: int
) -> dict[str, Any]:
    person = participant.person
    capsules, _ = quick_measures(quick, step_length_m(person.sex))
    grid_ns = np.arange(0, round(quick.t_s[-1] * NS_PER_S), STEP_NS, dtype=np.int64)
    position_m, orientation = participant.segments(BODY_JOINTS, start_ns + grid_ns)
    row = {"trial_id": trial.trial_id, "t_start_ns": 0, **trial.factors}
    walk = Walk(
        trial.trial_id, row, quick.crowd, grid_ns, position_m, orientation, person.stature_m
    )
    met = [c for c in collision_rows(walk, walk_volumes(walk, sex=person.sex)) if c["counted"]]
    return {
        "condition": trial.factors["condition"],
        "collisions_surfaces": len(met),
        "collisions_capsules": capsules["collisions"],
        "cubes_surfaces_dm3": np.mean([c[CUBES] for c in met]),
        "cubes_capsules_dm3": capsules[CUBES],
    }


def measure_rows(outcomes: Sequence[SeedOutcome]) -> list[dict[str, object]]:
    """Compare with the published means: one row per measure and block, and per Dice value."""
    rows: list[dict[str, object]] = []
    for measure, (means, sds) in PUBLISHED.items():
        for k, condition in enumerate(CONDITIONS):
            ours = np.array([o.mean[measure][k] for o in outcomes])
            within = float(np.mean([o.sd[measure][k] for o in outcomes]))
            rows.append(_row(measure, condition, means[k], ours, sds[k], within))
    for pair, printed in DICE.items():
        name = pair if isinstance(pair, str) else " ".join(pair)
        ours = np.array([o.dice[name] for o in outcomes])
        rows.append(_row("dice", name, printed, ours, None, None))
    return rows


def _row(
    measure: str,
    block: str,
    published: float | None,
    ours: Vector,
    published_sd: float | None,
    sd: float | None,
) -> dict[str, object]:
    mean = float(ours.mean())
    deviation = None if published is None else mean / published - 1
    return {
        "measure": measure,
        "block": block,
        "published": published,
        "mean": mean,
        "deviation_01": deviation,
        "kept": None if deviation is None else abs(deviation) <= LIMIT_01,
        "lowest_seed": float(ours.min()),
        "highest_seed": float(ours.max()),
        "published_sd": published_sd,
        "sd_over_people": sd,
    }


def pattern_rows(
    outcomes: Sequence[SeedOutcome], control: Sequence[SeedOutcome]
) -> list[dict[str, object]]:
    """Return the share of seeds in which each part of the pattern holds, and all of it."""
    rows: list[dict[str, object]] = []
    for name in [*(p[0] for p in PATTERN), SAME_PATHS, "all of it"]:
        row: dict[str, object] = {"part": name}
        for label, some in (("connected", outcomes), ("disconnected", control)):
            for kind in ("holds", "significant"):
                table = pd.DataFrame([getattr(o, kind) for o in some])
                if table.empty:
                    row[f"{label}_{kind}_01"] = None
                    continue
                values = table.all(axis=1) if name == "all of it" else table[name]
                row[f"{label}_{kind}_01"] = float(values.mean())
        rows.append(row)
    return rows


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--control-seeds", type=int, default=10)
    parser.add_argument("--participants", type=int, default=23)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--surfaces", type=int, default=0, help="people measured on surfaces")
    parser.add_argument("--keep", type=Path, help="file of studies done; made when missing")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    seeds = range(chosen.first_seed, chosen.first_seed + chosen.seeds)
    simulate = partial(
        simulate_studies,
        participants=chosen.participants,
        processes=chosen.processes,
        keep=chosen.keep,
    )
    outcomes = simulate(seeds, effect=True)
    control = simulate(seeds[: chosen.control_seeds], effect=False) if chosen.control_seeds else []
    measures, pattern = measure_rows(outcomes), pattern_rows(outcomes, control)
    changes = [
        {"measure": m, "block": c, "change_01": _change(control, m, k)}
        for m in PUBLISHED
        for k, c in ((1, HAPTIC), (2, AFTER))
        if control
    ]
    home = float(np.mean([o.home_01 for o in outcomes]))
    surfaces = surface_rows(chosen.surfaces, chosen.first_seed) if chosen.surfaces else []
    if chosen.json:
        print(
            json.dumps(
                {
                    "measures": measures,
                    "pattern": pattern,
                    "control": changes,
                    "home_01": home,
                    "surfaces": surfaces,
                }
            )
        )
        return
    print(
        f"{len(outcomes)} studies of {chosen.participants}; {home:.2%} of walks came back\n"
        f"{'measure':<21} {'block':<20} {'published':>9} {'ours':>7} {'off':>6} "
        f"{'seeds from':>10} {'to':>6} {'SD publ.':>8} {'SD':>6}"
    )
    for r in measures:
        off = "" if r["deviation_01"] is None else f"{r['deviation_01']:+.0%}"
        print(
            f"{r['measure']:<21} {r['block']:<20} {_text(r['published']):>9} "
            f"{_text(r['mean']):>7} {off:>6} {_text(r['lowest_seed']):>10} "
            f"{_text(r['highest_seed']):>6} {_text(r['published_sd']):>8} "
            f"{_text(r['sd_over_people']):>6}{' MISSED' if r['kept'] is False else ''}"
        )
    print(f"\nshare of seeds{'':<30} {'vibration felt':>16} {'disconnected':>16}")
    print(f"{'':<44} {'holds':>8} {'p<.05':>7} {'holds':>8} {'p<.05':>7}")
    for r in pattern:
        cells = [
            r[f"{label}_{kind}_01"]
            for label in ("connected", "disconnected")
            for kind in ("holds", "significant")
        ]
        print(
            f"{r['part']:<44} " + " ".join("      - " if c is None else f"{c:8.0%}" for c in cells)
        )
    print(f"limit of the source's orders: {100 * MIN_HOLDS_01:g} % of seeds")
    for r in changes:
        print(f"disconnected: {r['measure']} in {r['block']} {r['change_01']:+.1%} of {BEFORE}")
    for r in surfaces:
        print(
            f"characters' surfaces ({chosen.surfaces} walks of {r['block']}): "
            f"collisions {r['collisions_surfaces']:.1f} (capsules {r['collisions_capsules']:.1f}); "
            f"{CUBES} {r['cubes_surfaces_dm3']:.2f} (capsules {r['cubes_capsules_dm3']:.2f}, "
            f"published {_text(r['published'])})"
        )


def _change(control: Sequence[SeedOutcome], measure: str, block: int) -> float:
    first = np.mean([o.mean[measure][0] for o in control])
    return float(np.mean([o.mean[measure][block] for o in control]) / first - 1)


def _text(value: object) -> str:
    return "-" if value is None else f"{value:.3g}"


if __name__ == "__main__":
    main()

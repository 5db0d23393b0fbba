"""Compare the detectors of eye movements with people, on the labelled sets in a folder.

    python -m benchmarks.gaze_detectors FOLDER [--peers] [--json]

FOLDER holds any of the sets that `benchmarks.gaze_detectors.sets` names, which are not part of
Visavis. Each row is one detector on one set, a mean over the people who labelled it: fixations
(event F1 at half of the union; F1 of events that overlap at all; kappa and events over samples),
pursuit, saccades and oscillations, and samples per CPU second. `people` is one person
against another. Of the set that weights were fitted on, only clips not used for that count.
`--peers` adds other packages (`pip install visavis[peers]`), which are slow, on an evenly spaced
part of each set, each in its best ordinary setting for that set; the rows marked `part` compare
the same recordings.
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.gaze_detectors.agreement import Agreement, agreement, averaged
from benchmarks.gaze_detectors.peers import available_peers
from benchmarks.gaze_detectors.sets import SETS, Labels, Recording, is_tuned_on
from visavis.analysis.gaze.events import IDT_SCREEN, IVT_HEADSET, IVT_SCREEN, detect_idt, detect_ivt
from visavis.analysis.gaze.movements.detect import detect_movements
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.movements.parameters import AUTO, STILL
from visavis.lab.clock import cpu_time_s

Detect = Callable[[Recording], Labels]
PEOPLE = "people"
STILL_ROW = "auto, still pictures"
MEAN = "mean of sets"
GOAL_SETS = ("lund images", "lund dots", "hooge adults", "hooge infants", "gazecom", "lookatpoint")
GOALS = {"mean": 0.93, "least": 0.85, "pursuit": 0.60, "speed": 1e6}
KINDS = (Movement.FIXATION, Movement.PURSUIT, Movement.SACCADE, Movement.OSCILLATION)
PEER_SAMPLES = 30_000


def _adaptive(name: str) -> Detect:
    params = replace(AUTO, detector=name)  # type: ignore[arg-type]  # names of the table below
    return lambda r: detect_movements(r.t_ns, r.direction, params).movement


OWN: Mapping[str, Detect] = {
    "auto": _adaptive("auto"),
    STILL_ROW: lambda r: detect_movements(r.t_ns, r.direction, STILL).movement,
    "Engbert-Kliegl": _adaptive("engbert_kliegl"),
    "Nyström-Holmqvist": _adaptive("nystrom_holmqvist"),
    "I2MC": _adaptive("i2mc"),
    "I-VT screen": lambda r: detect_ivt(r.t_ns, r.direction, IVT_SCREEN).in_fixation.astype("i1"),
    "I-VT headset": lambda r: detect_ivt(r.t_ns, r.direction, IVT_HEADSET).in_fixation.astype("i1"),
    "I-DT screen": lambda r: detect_idt(r.t_ns, r.direction, IDT_SCREEN).in_fixation.astype("i1"),
}


@dataclass(frozen=True)
class Row:
    """One detector on one set; NaN where a set has no such label or a row no such figure."""

    data: str
    detector: str
    recordings: int
    fixation_f1: float
    fixation_overlap_f1: float
    fixation_kappa: float
    fixation_count_ratio: float
    pursuit_sample_f1: float
    pursuit_f1: float
    saccade_f1: float
    oscillation_f1: float
    samples_per_cpu_s: float


def _row(
    data: str, detector: str, count: int, by_kind: Mapping[Movement, Agreement], speed: float
) -> Row:
    fixation, pursuit, saccade, oscillation = (by_kind[kind] for kind in KINDS)
    return Row(
        data,
        detector,
        count,
        fixation.f1,
        fixation.overlap_f1,
        fixation.kappa,
        fixation.count_ratio,
        pursuit.sample_f1,
        pursuit.f1,
        saccade.f1,
        oscillation.f1,
        speed,
    )


def _is_labelled(recordings: Sequence[Recording], kind: Movement) -> bool:
    return any((b.movement == kind).any() for r in recordings for b in r.by.values())


NOTHING = Agreement(np.nan, np.nan, np.nan, np.nan, np.nan)


def people(data: str, recordings: Sequence[Recording]) -> Row | None:
    """Return how people agree with each other, the mean over pairs; None with one person."""
    pairs = list(combinations(sorted({who for r in recordings for who in r.by}), 2))
    if not pairs:
        return None
    by_kind = {}
    for kind in KINDS:
        each = []
        for a, b in pairs if _is_labelled(recordings, kind) else ():
            both = [(r.by[a], r.by[b]) for r in recordings if a in r.by and b in r.by]
            is_fixation = kind == Movement.FIXATION
            each.append(
                agreement(
                    [x.movement == kind for x, _ in both],
                    [y.movement == kind for _, y in both],
                    [x.fixations for x, _ in both] if is_fixation else None,
                    [y.fixations for _, y in both] if is_fixation else None,
                )
            )
        by_kind[kind] = averaged(each) if each else NOTHING
    return _row(data, PEOPLE, len(recordings), by_kind, np.nan)


def measured(data: str, name: str, recordings: Sequence[Recording], detect: Detect) -> Row:
    """Return a detector's agreement with each person, averaged, and its speed."""
    detect(recordings[0])
    began_s = cpu_time_s()
    found = [detect(r) for r in recordings]
    lasted_s = cpu_time_s() - began_s
    by_kind = {}
    for kind in KINDS:
        each = []
        people = sorted({who for r in recordings for who in r.by})
        for who in people if _is_labelled(recordings, kind) else ():
            own = [(r.by[who], f) for r, f in zip(recordings, found, strict=True) if who in r.by]
            each.append(
                agreement(
                    [x.movement == kind for x, _ in own],
                    [f == kind for _, f in own],
                    [x.fixations for x, _ in own] if kind == Movement.FIXATION else None,
                )
            )
        by_kind[kind] = averaged(each) if each else NOTHING
    samples = sum(len(r.t_ns) for r in recordings)
    return _row(data, name, len(recordings), by_kind, samples / lasted_s)


def part_of(recordings: Sequence[Recording], samples: int) -> list[Recording]:
    """Return evenly spaced recordings with about this many samples, at least one."""
    total = sum(len(r.t_ns) for r in recordings)
    every = max(1, round(total / samples))
    return list(recordings[::every])


def rows_of(folder: Path, *, with_peers: bool) -> list[Row]:
    """Return the table: for every set that is there people, own detectors, and peers if asked."""
    rows: list[Row] = []
    for data, read in SETS.items():
        recordings = [r for r in read(folder) if not is_tuned_on(data, r)]
        if not recordings:
            continue
        among = people(data, recordings)
        rows += [among] if among else []
        rows += [measured(data, name, recordings, detect) for name, detect in OWN.items()]
        if with_peers:
            part = part_of(recordings, PEER_SAMPLES)
            rows += [
                measured(data, f"{name}, part", part, OWN[name]) for name in ("auto", STILL_ROW)
            ]
            for name, settings in available_peers().items():
                tried = [measured(data, f"{name}, part", part, detect) for detect in settings]
                rows.append(max(tried, key=lambda row: row.fixation_f1))
    return rows


def means_of(rows: Sequence[Row]) -> list[Row]:
    """Return for each detector the mean of its figures over `GOAL_SETS` that are there."""
    means = []
    for name in dict.fromkeys(r.detector for r in rows):
        own = [r for r in rows if r.detector == name and r.data in GOAL_SETS]
        if own:
            f1 = [r.fixation_f1 for r in own]
            unknown: dict[str, Any] = dict.fromkeys(_FIGURES, np.nan)
            fill = replace(own[0], **unknown)
            means.append(
                replace(
                    fill,
                    data=f"{MEAN} ({len(own)})",
                    recordings=sum(r.recordings for r in own),
                    fixation_f1=float(np.mean(f1)),
                    fixation_overlap_f1=float(np.mean([r.fixation_overlap_f1 for r in own])),
                    fixation_kappa=float(np.mean([r.fixation_kappa for r in own])),
                )
            )
    return means


_FIGURES = tuple(asdict(Row("", "", 0, *[0.0] * 9)))[3:]


def verdicts(rows: Sequence[Row]) -> list[str]:
    """Return, goal by goal, what `auto` reached."""
    auto = [r for r in rows if r.detector == "auto" and r.data in GOAL_SETS]
    f1 = {r.data: r.fixation_f1 for r in auto}
    lines = [
        f"fixation F1, mean of {len(f1)} sets: {np.mean(list(f1.values())):.3f} "
        f"(goal {GOALS['mean']})"
    ]
    least = min(f1, key=lambda k: f1[k])
    lines.append(f"fixation F1, least: {f1[least]:.3f}, {least} (goal {GOALS['least']})")
    among = {r.data: r.fixation_f1 for r in rows if r.detector == PEOPLE and r.data in f1}
    if among:
        own = np.mean([f1[k] for k in among])
        most = np.mean([among.get(k, 1.0) for k in f1])
        lines += [
            f"where several people labelled ({len(among)} sets), they agree with each other by "
            f"{np.mean(list(among.values())):.3f}, auto with them by {own:.3f}",
            f"who agreed with people as they do there, and never erred elsewhere: {most:.3f} on "
            f"average",
        ]
    lines += [
        f"pursuit on gazecom: {r.pursuit_sample_f1:.3f} by samples, {r.pursuit_f1:.3f} by events "
        f"(goal {GOALS['pursuit']})"
        for r in auto
        if r.data == "gazecom"
    ]
    slowest = min((r for r in rows if r.detector in OWN), key=lambda r: r.samples_per_cpu_s)
    lines.append(
        f"slowest own detector: {slowest.detector} on {slowest.data}, "
        f"{slowest.samples_per_cpu_s / 1e6:.2f} M samples per CPU s (goal 1)"
    )
    return lines


def _print(rows: Sequence[Row]) -> None:
    heads = ("F1", "overlap", "kappa", "found", "pursuit", "events", "saccade", "oscill.")
    print(f"{'set':<17} {'detector':<26} {'n':>4} " + " ".join(f"{h:>7}" for h in heads) + "  M/s")
    for r in rows:
        figures = [getattr(r, name) for name in _FIGURES[:-1]]
        cells = " ".join("      –" if np.isnan(x) else f"{x:7.3f}" for x in figures)
        speed = "" if np.isnan(r.samples_per_cpu_s) else f"{r.samples_per_cpu_s / 1e6:6.3f}"
        print(f"{r.data:<17} {r.detector:<26} {r.recordings:>4} {cells} {speed}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table and what was reached; return 1 when the folder holds no set."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--peers", action="store_true", help="other packages, too (slow)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    options = parser.parse_args(arguments)
    rows = rows_of(options.folder, with_peers=options.peers)
    if not rows:
        print(f"{options.folder}: no labelled set found; looked for {', '.join(SETS)}")
        return 1
    rows += means_of(rows)
    if options.json:
        table = [{k: None if v != v else v for k, v in asdict(r).items()} for r in rows]
        print(json.dumps(table, indent=1, ensure_ascii=False))
    else:
        _print(rows)
        print("\n".join(verdicts(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Print how fast the statistics are: ``python -m benchmarks.statistics [--studies 1000] [--json]``.

Times are CPU seconds of one core. Peers are measured in the same run where Python has one; the R
figures were measured beforehand.
``--error-rates N`` prints instead how often each analysis finds an effect that is not there, in N
simulated studies per kind of data (the figures of docs/statistics.md; 2000 take about a minute).
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from visavis.analysis import statistics
from visavis.lab.clock import cpu_time_s

R_STUDY_S = 0.091
"""ARTool 0.11.2 on R 4.2.2, one 16 × 2 × 3 study, strata test; measured on a similar machine."""


@dataclass(frozen=True)
class Line:
    """One row of the benchmark; `ratio` is peer (or limit) over value, so more is better."""

    name: str
    value: float
    unit: str
    peer: str
    peer_value: float

    @property
    def ratio(self) -> float:
        """How many times better than the peer or limit."""
        return self.peer_value / self.value


def study(rng: np.random.Generator) -> dict[str, Any]:
    """Return one simulated 16 × 2 × 3 within study as a tidy frame."""
    n = 16
    direction = np.tile(["front", "left", "right"], 2 * n)
    y = rng.normal(size=6 * n) + np.repeat(rng.normal(size=n), 6) + 0.4 * (direction == "left")
    return {
        "subject": np.repeat([f"S{i:02d}" for i in range(n)], 6),
        "technique": np.tile(np.repeat(["baseline", "warping"], 3), n),
        "direction": direction,
        "accuracy": y,
    }


def analyse(frame: dict[str, Any]) -> statistics.ArtAnova:
    """Run the ART ANOVA of one study."""
    return statistics.art_anova(
        frame, "accuracy", subject="subject", within=("technique", "direction")
    )


def analyse_in_full(frame: dict[str, Any]) -> None:
    """Run ANOVA, all contrasts, double differences and parametric post-hocs of one study."""
    table = analyse(frame)
    for term in ("technique", "direction", "technique:direction"):
        statistics.art_contrasts(table, term)
    statistics.art_interaction_contrasts(table, "technique:direction")
    parametric = statistics.rm_anova(
        frame, "accuracy", subject="subject", within=("technique", "direction")
    )
    statistics.posthoc(parametric, "direction", adjust="tukey")


def median_s(function: Callable[[], object], repeats: int) -> float:
    """Return the median CPU seconds of a call, after one warm-up."""
    function()
    times = []
    for _ in range(repeats):
        started = cpu_time_s()
        function()
        times.append(cpu_time_s() - started)
    return float(np.median(times))


def import_s(module: str) -> float:
    """Return the seconds a fresh interpreter takes to import a module, less its start.

    CPU seconds, the best of seven.
    """

    def started(code: str) -> float:
        times = []
        for _ in range(7):
            before = os.times()
            subprocess.run([sys.executable, "-c", code], check=True)
            after = os.times()
            user = after.children_user - before.children_user
            times.append(user + after.children_system - before.children_system)
        return min(times)

    return started(f"import {module}") - started("pass")


def measure(n_studies: int) -> list[Line]:
    """Run everything once, so many studies in a row, and return the rows."""
    from scipy import stats

    rng = np.random.default_rng(7)
    frames = [study(rng) for _ in range(max(n_studies, 3))]
    analyse(frames[0])
    started = cpu_time_s()
    for frame in frames:
        analyse(frame)
    thousand = (cpu_time_s() - started) * 1000 / len(frames)
    full = median_s(lambda: analyse_in_full(frames[1]), 100)
    table = analyse(frames[1])
    mixed = median_s(
        lambda: statistics.art_anova(
            frames[1],
            "accuracy",
            subject="subject",
            within=("technique", "direction"),
            error="mixed",
        ),
        20,
    )
    q = np.linspace(0.5, 6.0, 15)
    ours = median_s(lambda: statistics.studentized_range_sf(q, 6, 75.0), 100)
    theirs = median_s(lambda: stats.studentized_range.sf(q, 6, 75.0), 3)
    pairs = frames[2]["accuracy"].reshape(48, 2)
    exact = median_s(lambda: statistics.wilcoxon_signed_rank(pairs[:, 0], pairs[:, 1]), 100)
    shapiro = median_s(lambda: statistics.compare_paired(pairs[:, 0], pairs[:, 1]), 100)
    assert len(table.effects) == 3
    return [
        Line("1000 ART studies 16x2x3", thousand, "s", "limit", 5.0),
        Line("1000 ART studies 16x2x3", thousand, "s", "R ARTool", 1000 * R_STUDY_S),
        Line("ART, contrasts, post-hoc of one study", 1e3 * full, "ms", "limit", 10.0),
        Line("ART by mixed model, Kenward-Roger", 1e3 * mixed, "ms", "R ARTool", 570.0),
        Line("15 Tukey probabilities", 1e3 * ours, "ms", "scipy", 1e3 * theirs),
        Line("exact signed rank, 48 pairs", 1e3 * exact, "ms", "limit", 10.0),
        Line("paired decision path, 48 pairs", 1e3 * shapiro, "ms", "limit", 10.0),
        Line("import of the package", import_s("visavis.analysis.statistics"), "s", "limit", 0.5),
        Line(
            "import of the package",
            import_s("visavis.analysis.statistics"),
            "s",
            "statsmodels.api",
            import_s("statsmodels.api"),
        ),
    ]


def null_data(kind: str, rng: np.random.Generator) -> dict[str, Any]:
    """Return a 16 × 2 × 3 study in which A has no effect; B has one unless the kind says not."""
    n = 16
    z = rng.normal(size=(n, 2, 3)) + rng.normal(size=(n, 1, 1))
    effect = np.array([0.0, 0.8, 1.6])
    if kind == "normal, no effect":
        y = z
    elif kind == "normal, B differs":
        y = z + effect
    elif kind == "subjects differ in B":
        y = z + rng.normal(0, 0.5, size=(n, 1, 3))
    elif kind == "subjects differ in A":
        y = z + rng.normal(0, 1.0, size=(n, 2, 1))
    elif kind == "lognormal, B differs":
        y = np.exp(z + effect)
    elif kind == "rating 1-9, B differs":
        y = np.clip(np.round(6.0 + 1.5 * z + effect), 1, 9)
    else:
        y = rng.binomial(9, 1 / (1 + np.exp(-(1.0 + z + effect)))) / 9
    return {
        "s": np.repeat(np.arange(n), 6),
        "A": np.tile(np.repeat([0, 1], 3), n),
        "B": np.tile([0, 1, 2], 2 * n),
        "y": y.ravel(),
    }


KINDS = (
    "normal, no effect",
    "normal, B differs",
    "subjects differ in B",
    "subjects differ in A",
    "lognormal, B differs",
    "rating 1-9, B differs",
    "share of 9, B differs",
)
"""Data in which A never has an effect."""


def error_rates(n_studies: int) -> None:
    """Print the share of studies with p < .05 where nothing is to be found."""
    rng = np.random.default_rng(11)
    design: dict[str, Any] = {"subject": "s", "within": ("A", "B")}
    print(f"{'data':24} term   own error   pooled   inverse normal   RM ANOVA   ({n_studies} each)")
    for kind in KINDS:
        terms = ("A", "B", "A:B") if "differs" not in kind else ("A",)
        hits = {term: np.zeros(4) for term in terms}
        for _ in range(n_studies):
            frame = null_data(kind, rng)
            strata = statistics.art_anova(frame, "y", correction="none", **design)
            pooled = statistics.art_anova(frame, "y", error="pooled", correction="none", **design)
            parametric = statistics.rm_anova(frame, "y", correction="none", **design)
            for term in terms:
                scores = (strata.second_opinion or {})[term]
                p = [
                    strata.effect(term).p,
                    pooled.effect(term).p,
                    scores,
                    parametric.effect(term).p,
                ]
                hits[term] += np.array(p) < 0.05
        for term in terms:
            own, one, scores, plain = hits[term] / n_studies
            print(f"{kind:24} {term:4} {own:11.3f} {one:8.3f} {scores:16.3f} {plain:10.3f}")


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description="Measure the statistics package.")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--studies", type=int, default=1000)
    parser.add_argument("--error-rates", type=int, metavar="N", default=0)
    options = parser.parse_args()
    if options.error_rates:
        error_rates(options.error_rates)
        return
    lines = measure(options.studies)
    if options.json:
        print(json.dumps([{**asdict(line), "ratio": line.ratio} for line in lines], indent=1))
        return
    for line in lines:
        print(
            f"{line.name:40} {line.value:9.3f} {line.unit:3} "
            f"{line.peer:16} {line.peer_value:9.3f} {line.unit:3} {line.ratio:8.1f} x"
        )


if __name__ == "__main__":
    main()

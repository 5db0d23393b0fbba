"""Further sections of the report: pairs kept, their clusters beside the printed ones, agreement."""

from typing import Final

import numpy as np
from matplotlib.figure import Figure
from scipy.cluster.hierarchy import dendrogram, linkage

from visavis.analysis.plots import draw, new_figure
from visavis.analysis.report import Block, Paragraph, Section
from visavis.analysis.report.blocks import Column, Table
from visavis.analysis.report.notation import decimal
from visavis.analysis.statistics.errors import StatisticsError
from visavis.experiments.adjectives.clustering import Impressions, rating_cube
from visavis.experiments.adjectives.pairs import FACTORS, PAIRS, PRINTED, printed_cluster
from visavis.experiments.adjectives.prediction import left_out_r2
from visavis.experiments.adjectives.walks import WALKS, features_seen, walk_name, walk_of
from visavis.protocol.plan.columns import Column as TableColumn
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

COLOURS: Final = dict(zip(FACTORS, ("#4477aa", "#ee6677", "#228833", "#aa3377"), strict=True))
KEPT_IN_SOURCE: Final = {"A": 27, "B": 29}


def impressions(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return selection, clusters with their dendrogram, reliability and the impression matrix."""
    rows = analysis.selection.counted
    levels = experiment.levels
    walks = tuple(walk_name(str(e), str(s)) for e in levels["emotion"] for s in levels["speed"])
    ratings = rating_cube(rows, walks)
    title = "Which adjectives say something, and which belong together"
    if len(ratings) < 2:
        words = f"{len(ratings)} people rated every walk on every pair; at least two must."
        return Extra(Section("impressions", title, (Paragraph(words),)))
    impressions = Impressions(walks, ratings)
    blocks: list[Block] = [_pairs_kept(impressions)]
    try:
        clusters = impressions.cluster_of
    except StatisticsError as problem:
        blocks.append(Paragraph(f"Clusters cannot be formed: {problem}"))
        return Extra(Section("impressions", title, (*blocks, _pairs(impressions, {}))))
    figure = draw(
        "dendrogram",
        lambda: _tree(impressions),
        title="Pairs of adjectives that are rated alike",
        caption="Ward's clusters of the pairs kept, by their mean ratings of all walks. Heights "
        "are √(2 ΔE), where ΔE is the increase of the sum of squares within clusters; colours are "
        f"the {len(FACTORS)} clusters into which the tree is cut.",
        alternative=f"A tree of {len(impressions.kept)} pairs in {len(FACTORS)} clusters.",
        is_simulated=analysis.is_simulated,
    )
    blocks += [
        picture_of(figure),
        _clusters(impressions),
        _pairs(impressions, dict(zip(impressions.kept, clusters, strict=True))),
        _prediction(impressions, walks),
    ]
    matrix = impressions.matrix()
    columns = (
        TableColumn("name", "", "the walk"),
        *(TableColumn(f, "1", f"primary parameter {f}, 0 to 1") for f in FACTORS),
        *(TableColumn(p, "1", f"mean rating of {p}, 0 to 1") for p in impressions.kept),
    )
    return Extra(
        Section("impressions", title, tuple(blocks)), (figure,), {"impressions": matrix}, columns
    )


def _pairs_kept(impressions: Impressions) -> Paragraph:
    selection = impressions.selection
    weak = int((selection.max_abs_mean < 1.0 - 1e-12).sum())
    count = len(impressions.kept)
    return Paragraph(
        f"{count} of {len(PAIRS)} pairs are kept by {len(impressions.ratings)} raters of "
        f"{len(impressions.walks)} walks (the source: {KEPT_IN_SOURCE['A']} for its 10 walks, "
        f"{KEPT_IN_SOURCE['B']} for its 27). Left out are {weak} pairs that no walk moves by a "
        f"step of the scale, and {len(PAIRS) - count - weak} about which raters differ "
        "by more than .85 (mean standard deviation)."
    )


def _clusters(impressions: Impressions) -> Table:
    rows = []
    for factor in FACTORS:
        own = [
            p for p, c in zip(impressions.kept, impressions.cluster_of, strict=True) if c == factor
        ]
        alpha = impressions.cluster_alpha(factor)
        rows.append(
            (
                factor,
                ", ".join(p.replace("_", "–") for p in own),
                decimal(alpha, 2) if np.isfinite(alpha) else "–",
                *(
                    f"{sum(p in PRINTED[s][factor] for p in own)} of {len(PRINTED[s][factor])}"
                    for s in ("A", "B")
                ),
            )
        )
    return Table(
        (
            Column("cluster"),
            Column("pairs"),
            Column("α", "right"),
            Column("in the source's, set A", "right"),
            Column("set B", "right"),
        ),
        tuple(rows),
        "Four clusters of pairs",
        "Called as the source's cluster of set B with which they share most. α: Cronbach's of the "
        "cluster's pairs, over all ratings of walks. Its counts: how many of the pairs that the "
        "source printed in this cluster are in ours.",
    )


def _pairs(impressions: Impressions, cluster_of: dict[str, str]) -> Table:
    selection = impressions.selection
    rows = []
    for i, pair in enumerate(PAIRS):
        single, alpha = impressions.reliability(pair)
        rows.append(
            (
                pair.replace("_", "–"),
                decimal(float(selection.max_abs_mean[i]), 2),
                decimal(float(selection.mean_spread[i]), 2),
                decimal(single, 2) if np.isfinite(single) else "–",
                decimal(alpha, 2) if np.isfinite(alpha) else "–",
                cluster_of.get(pair, "left out"),
                *(printed_cluster(pair, s) or "left out" for s in ("A", "B")),
            )
        )
    return Table(
        (
            Column("pair"),
            Column("max |M|", "right"),
            Column("mean SD", "right"),
            Column("ICC2", "right"),
            Column("α", "right"),
            Column("cluster"),
            Column("printed, set A"),
            Column("printed, set B"),
        ),
        tuple(rows),
        "All pairs",
        "Kept where max |M| ≥ 1.00 and mean SD ≤ .85. ICC2: agreement of single raters about the "
        "walks; α: Cronbach's of all raters (ICC3k).",
    )


def _prediction(impressions: Impressions, walks: tuple[str, ...]) -> Paragraph:
    if set(walks) - set(WALKS):
        return Paragraph("Features of these walks are not known, so nothing is predicted of them.")
    features = np.array([list(features_seen(walk_of(w)).values()) for w in walks])
    words = ", ".join(
        f"{factor} {decimal(left_out_r2(features, impressions.primary[:, k]), 2)}"
        for k, factor in enumerate(FACTORS)
    )
    return Paragraph(
        "Beyond the source: how well the primary parameters of a walk can be told from its 51 "
        "motion features alone (ridge regression, every walk predicted from the others; R²): "
        f"{words}."
    )


def _tree(impressions: Impressions) -> Figure:
    """Return the dendrogram of the pairs kept, its branches in the colours of their clusters."""
    profiles = impressions.selection.profiles
    tree = linkage(profiles, "ward")
    factor_below: dict[int, str | None] = dict(enumerate(impressions.cluster_of))
    for k, (a, b, *_) in enumerate(tree):
        one, other = factor_below[int(a)], factor_below[int(b)]
        factor_below[len(profiles) + k] = one if one == other else None

    def colour(node: int) -> str:
        factor = factor_below[node]
        return "#888888" if factor is None else COLOURS[factor]

    figure = new_figure(6.4, 0.9 + 0.19 * len(profiles))
    axes = figure.add_subplot()
    branches = dendrogram(
        tree,
        orientation="left",
        labels=[pair.replace("_", "–") for pair in impressions.kept],
        link_color_func=colour,
        ax=axes,
    )
    for label, i in zip(axes.get_yticklabels(), branches["leaves"] or (), strict=True):
        label.set(color=COLOURS[impressions.cluster_of[i]], fontsize=8)
    heights = impressions.clusters.heights
    cut = float(heights[-len(FACTORS)] + heights[-len(FACTORS) + 1]) / 2
    axes.axvline(cut, color="#444444", linestyle="--", linewidth=0.8)
    axes.set(xlabel="distance of clusters, √(2 ΔE)")
    axes.legend(
        handles=[axes.plot([], [], color=COLOURS[f], linewidth=2, label=f)[0] for f in FACTORS],
        ncols=len(FACTORS),
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        frameon=False,
    )
    return figure

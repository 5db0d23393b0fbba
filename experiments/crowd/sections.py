"""Further sections of the crowd study's report, after the standard ones."""

from typing import Any, Final

import numpy as np
import pandas as pd

from visavis.analysis.collisions.series import MIN_DURATION_NS, THRESHOLD_M3
from visavis.analysis.gait import HESITATION_AT_LEAST_S, HESITATION_BELOW_M_S, STEP_LENGTH_M
from visavis.analysis.report import Block, Bullets, Cell, Column, Fold, Paragraph, Section, Table
from visavis.analysis.report.notation import (
    MISSING,
    decimal,
    fraction,
    interval,
    mean_sd,
    percentage,
    probability,
)
from visavis.experiments.crowd import published
from visavis.experiments.crowd.columns import SIMILARITY
from visavis.experiments.crowd.figures import analysed_collisions, collision_figures
from visavis.experiments.crowd.figures_paths import path_figures
from visavis.experiments.crowd.figures_walks import walks_figure
from visavis.experiments.crowd.paths import VARIANT_NAMES, VARIANTS, GroupPaths
from visavis.results.analysis import StudyAnalysis
from visavis.results.report.study_report import picture_of
from visavis.study.experiment import StudyExperiment
from visavis.study.sections import Extra

ARM_PARTS: Final = ("upper_arm", "lower_arm", "hand")
RULES: Final = {
    "volume": (
        "the true common volume of the two closed surfaces: signed intervals along columns 1 cm "
        "apart, finer where small, inside where the surface winds round a point"
    ),
    "centres": "1 cm cubes whose centre lies in both bodies",
    "published": (
        "1 cm cubes that touch both bodies, counted only where they really share volume; "
        "overstates a volume about twofold"
    ),
}
SURFACES: Final = {
    "characters": "the closed collision meshes of the characters that were shown",
    "fine": "a closed body of about 15,000 triangles round the capsules of contact",
    "light": "a closed body of about 3,000 triangles round the capsules of contact",
    "capsules": "the nineteen capsules of contact themselves, along columns 12.5 mm apart",
}


def paths_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return what was found of paths: maps, similarity, equivalence."""
    groups: tuple[GroupPaths, ...] = analysis.further
    main = groups[0]
    similarity, *maps = path_figures(analysis, main)
    blocks: list[Block] = [
        picture_of(similarity),
        equivalence_table(main),
        similarity_table(main),
        fair_table(main),
        *(picture_of(figure) for figure in maps[:1]),
    ]
    if maps[1:]:
        others = len(maps) - 1
        title = "The other configuration" if others == 1 else f"The other {others} configurations"
        blocks.append(Fold(title, tuple(picture_of(figure) for figure in maps[1:])))
    rows = pd.DataFrame([row for group in groups for row in similarity_rows(group)])
    section = Section("paths", "Paths and cells", tuple(blocks))
    return Extra(section, (similarity, *maps), {"similarity": rows}, SIMILARITY)


def walks_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return single walks from above, with where they met people."""
    figure, walks = walks_figure(analysis, analysis.further[0])
    section = Section("walks", "Walks and contacts", (picture_of(figure),))
    return Extra(section, (figure,), trials=walks)


def body_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return where and how people were hit, and how shoulders turned at gaps."""
    main = analysis.further[0]
    collisions, shoulders = collision_figures(analysis, main)
    facts = collision_facts(main, analysis.tables["collisions"])
    blocks = (
        picture_of(collisions),
        collision_table(facts, analysis.measured_by),
        picture_of(shoulders),
    )
    section = Section("body", "Collisions and shoulders", blocks)
    return Extra(section, (collisions, shoulders))


def haptics_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return how long contacts took to be felt."""
    pulses = analysis.tables["pulses"]
    block = Paragraph("No vibration was commanded.") if pulses.empty else pulse_table(pulses)
    return Extra(Section("haptics", "Vibrations", (block,)))


def measured_section(analysis: StudyAnalysis, experiment: StudyExperiment) -> Extra:
    """Return how walks were measured, and in what that differs from the source."""
    how, t = analysis.how, analysis.thresholds
    as_published = how.rule == "published"
    paragraphs = (
        f"Collisions. Body and crowd are rebuilt every 10 ms. Volumes are by rule {how.rule!r}: "
        f"{RULES[how.rule]}; surfaces: {SURFACES[how.surface]}. A collision is one pair of "
        f"participant and character from the first to the last step above {THRESHOLD_M3:g} m³, "
        f"counted when longer than {MIN_DURATION_NS // 1_000_000} ms; its value is the largest "
        "volume. Body part and side are those of the participant nearest to the centre of the "
        "common volume at its largest; speed is that of the hips at first contact.",
        "Paths. Cells are the Delaunay triangles between people's positions in whole micrometres; "
        "path segments are walked exactly. Shoulder rotation is the angle between the line of the "
        "shoulders and the gap at every crossing between two people, 0–90°, and beside it the "
        f"same at gaps of at most {how.narrow_gap_m:g} m and the angle to the walking direction. "
        f"Bounds of equal paths: ±{t.dice_bound:g} in Dice, ±{percentage(t.path_bound_01, 0)} of "
        "the path length; fixed before looking.",
        "Walking speed leaves out what lies within one step "
        f"({STEP_LENGTH_M['man']} m men, {STEP_LENGTH_M['woman']} m women) of the point nearest "
        f"the board. A hesitation is slower than {HESITATION_BELOW_M_S} m/s for at least "
        f"{HESITATION_AT_LEAST_S} s outside that stop, once walking has begun. "
        "Clearance is the distance to the nearest person's centre.",
    )
    differences: tuple[str, ...] = (
        "the crowds follow the source's density and spacing, but are not its eight crowds",
        "paths are also compared at equal group sizes with different people on both sides, and "
        "tested for equivalence; the source compared whole blocks with halves",
        "contact needs the arms' capsules; the source's avatars had a capsule per segment too",
        "people of neither or unknown sex have the mean step of men and women",
    )
    if not as_published:
        true = (
            "volumes are true common volumes; the source counted cubes that touch both bodies, "
            "which overstates a common volume about twofold and lets near misses count. Beside the "
            "printed volumes stands the source's rule, of our collisions at their largest"
        )
        differences = (true, *differences)
    blocks: tuple[Block, ...] = (
        *(Paragraph(text) for text in paragraphs),
        Paragraph("Differences from the source:"),
        Bullets(differences),
        Fold("What does not fit in the published text", (Bullets(published.INCONSISTENCIES),)),
    )
    return Extra(Section("measuring", "How walks were measured", blocks))


def similarity_table(group: GroupPaths) -> Table:
    """Return Dice by configuration and pair of blocks beside the published table."""
    columns = [Column("Configuration")]
    pairs = group.paths.block_pairs
    for pair in pairs:
        columns += [
            Column("here", "right", _name(pair)),
            Column("publ.", "right", _name(pair)),
        ]
    rows: list[tuple[Cell | str, ...]] = []
    for k, configuration in enumerate(group.paths.configurations):
        row: list[Cell | str] = [str(configuration)]
        for pair in pairs:
            value = float(group.paths.pair(pair).by_configuration[k])
            published_dice = published.DICE_BETWEEN[pair][configuration - 1]
            row += [fraction(value, 3), Cell(fraction(published_dice, 3), "weak")]
        rows.append(tuple(row))
    last: list[Cell | str] = ["Mean (SD)"]
    for pair in pairs:
        similarity, source = group.paths.pair(pair), published.DICE_BETWEEN_ALL[pair]
        last += [
            Cell(mean_sd(similarity.mean, similarity.sd, 3), "strong"),
            Cell(mean_sd(source.mean, source.sd, 3), "weak"),
        ]
    rows.append(tuple(last))
    within = group.paths.within["union"].ravel()
    here = mean_sd(float(within.mean()), float(within.std(ddof=1)), 3) if within.size > 1 else "–"
    return Table(
        tuple(columns),
        tuple(rows),
        "Similarity of paths between blocks, as published (Dice, union of cells)",
        f"n = {group.paths.n_people} here, {published.PARTICIPANTS} published. Within a block, "
        f"random halves as published: {here} here, "
        f"{mean_sd(published.DICE_WITHIN.mean, published.DICE_WITHIN.sd, 3)} published. The "
        "crowds are ours, so a configuration's number is not a pairing. See below before comparing "
        "between with within.",
    )


def fair_table(group: GroupPaths) -> Table:
    """Return all variants of Dice: whole blocks, halves, and matched groups of other people."""
    columns = (
        Column("Variant"),
        Column("Blocks"),
        Column("between, whole blocks", "right", "As published"),
        Column("within, halves", "right", "As published"),
        Column("between", "right", "Equal sizes, other people"),
        Column("within", "right", "Equal sizes, other people"),
        Column("within − between", "right", "Equal sizes, other people"),
        Column("p", "right", "Equal sizes, other people"),
    )
    rows = []
    for variant in VARIANTS:
        within = group.paths.within[variant]
        for pair in group.paths.block_pairs:
            similarity = group.paths.pair(pair, variant)
            fair = similarity.fair
            halves = float(within.mean()) if within.size else None
            cells: tuple[Cell | str, ...] = (
                VARIANT_NAMES[variant],
                _name(pair),
                fraction(similarity.mean, 3),
                fraction(halves, 3),
            )
            if fair is None:
                rows.append((*cells, Cell("too few", "weak", similarity.problem), *[MISSING] * 3))
                continue
            rows.append(
                (
                    *cells,
                    fraction(fair.between, 3),
                    fraction(fair.within, 3),
                    fraction(fair.difference, 3),
                    probability(fair.p),
                )
            )
    some = next((p.fair for p in group.paths.pairs if p.fair is not None), None)
    how = (
        ""
        if some is None
        else f"{some.n_splits} seeded splits, {some.n_permutations} permutations that exchange "
        "all walks of a person between the two blocks. "
    )
    return Table(
        columns,
        tuple(rows),
        "The same compared fairly",
        f"{how}Whole blocks hold more people than halves, and the same people on both sides: both "
        "raise Dice without any effect of the block.",
    )


def equivalence_table(group: GroupPaths) -> Table:
    """Return the equivalence tests of paths."""
    columns = (
        Column("Blocks"),
        Column("What"),
        Column("n", "right"),
        Column("Difference [90 % CI]", "right"),
        Column("Bounds", "right"),
        Column("p", "right"),
        Column("Equivalent", "centre"),
    )
    rows: list[tuple[Cell | str, ...]] = []
    tests = [
        (f.pair, "excess similarity within a block (Dice)", f.test or f.problem, 3)
        for f in group.paths.equivalence
    ]
    tests += [(p, "path length (m)", t, 2) for p, t in group.lengths.items()]
    for pair, what, test, digits in tests:
        if isinstance(test, str):
            rows.append(
                (_name(pair), what, MISSING, Cell("not tested", "weak", test), *[MISSING] * 3)
            )
            continue
        value = decimal(test.estimate, digits)
        bounds = interval(test.interval.low, test.interval.high, digits)
        rows.append(
            (
                _name(pair),
                what,
                str(test.provenance.n),
                f"{value} {bounds}",
                interval(test.low, test.high, digits),
                probability(test.p),
                Cell("yes", "agree") if test.is_equivalent else Cell("not shown", "differ"),
            )
        )
    return Table(
        columns,
        tuple(rows),
        "Are paths the same? Two one-sided tests",
        "Excess: mean Dice of a person's path with the others' paths of the same block, less that "
        "with their paths of the other block; people are the units, and the interval comes from "
        "leaving out one person at a time, as everybody is compared with everybody.",
    )


def _name(pair: tuple[str, str]) -> str:
    return f"{pair[0]} – {pair[1]}"


def collision_facts(group: GroupPaths, collisions: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return named numbers per walk by block, of a group's walks that are analysed."""
    walks_of_group = group.counted_walks
    rows = analysed_collisions(group, collisions)
    facts = {}
    for condition in group.paths.blocks:
        walks = int((walks_of_group["condition"] == condition).sum())
        block = rows[rows["condition"] == condition] if len(rows) else rows
        if not walks:
            continue
        part = block["body_part"] if len(block) else pd.Series(dtype=str)
        side = block["side"] if len(block) else pd.Series(dtype=str)
        facts[condition] = {
            "counted": len(block) / walks,
            "with an arm or hand": float(part.isin(ARM_PARTS).sum()) / walks,
            "on the left side": float((side == "left").sum()) / walks,
            "on the right side": float((side == "right").sum()) / walks,
            "in the middle": float((side == "middle").sum()) / walks,
            "cut by lost tracking or the walk's end": (
                float(block["cut"].sum()) / walks if len(block) else 0.0
            ),
            "largest common volume, median (dm³)": _median(block, "max_volume_dm3"),
            "duration, median (s)": _median(block, "duration_s"),
            "speed at contact, median (m/s)": _median(block, "speed_m_s"),
        }
    return facts


def _median(block: pd.DataFrame, column: str) -> float:
    if not len(block):
        return float("nan")
    values = block[column].to_numpy(float)
    values = values[np.isfinite(values)]
    return float(np.median(values)) if values.size else float("nan")


def collision_table(rows_of: dict[str, dict[str, float]], measured_by: str) -> Table:
    """Return facts about single collisions by block."""
    names = list(next(iter(rows_of.values()))) if rows_of else []
    columns = (Column("Collisions"), *(Column(c, "right") for c in rows_of))
    rows = tuple((name, *(decimal(rows_of[c][name], 2) for c in rows_of)) for name in names)
    note = f"Measured by {measured_by}."
    return Table(columns, rows, "Counted collisions, mean per walk", note)


def similarity_rows(group: GroupPaths) -> list[dict[str, Any]]:
    """Return one row per variant and pair of blocks with every similarity of a group."""
    rows = []
    for similarity in group.paths.pairs:
        within = group.paths.within[similarity.variant]
        row: dict[str, Any] = {
            "group": group.group,
            "variant": similarity.variant,
            "first": similarity.pair[0],
            "second": similarity.pair[1],
            "between_blocks": similarity.mean,
            "between_blocks_sd": similarity.sd,
            "within_block_halves": float(within.mean()) if within.size else None,
            "within_block_halves_sd": float(within.std(ddof=1)) if within.size > 1 else None,
        }
        if similarity.fair is not None:
            row |= {
                "matched_between": similarity.fair.between,
                "matched_within": similarity.fair.within,
                "matched_difference": similarity.fair.difference,
                "permutation_p": similarity.fair.p,
                "n_people": similarity.fair.n_people,
                "n_splits": similarity.fair.n_splits,
                "n_permutations": similarity.fair.n_permutations,
            }
        for configuration, value in zip(
            group.paths.configurations, similarity.by_configuration, strict=True
        ):
            row[f"between_{configuration}"] = float(value)
        rows.append(row)
    return rows


STAGES: Final = (
    ("commanded_ms", "commanded"),
    ("sent_ms", "on the wire"),
    ("acknowledged_ms", "acknowledged"),
    ("risen_ms", "motor at 63 % (modelled rise)"),
    ("held_ms", "contact ended"),
)


def pulse_table(pulses: pd.DataFrame) -> Table:
    """Return median, 95th percentile and largest delay from the contact's sample."""
    rows = []
    for column, label in STAGES:
        values = pd.to_numeric(pulses[column], errors="coerce").dropna()
        count = str(len(values))
        if values.empty:
            rows.append((label, count, "–", "–", "–"))
            continue
        rows.append(
            (
                label,
                count,
                decimal(float(values.median()), 2),
                decimal(float(values.quantile(0.95)), 2),
                decimal(float(values.max()), 2),
            )
        )
    n_lost = int((~pulses["acknowledged"].astype(bool)).sum())
    return Table(
        (
            Column("From the body sample that showed the contact until"),
            Column("pulses", "right"),
            Column("median (ms)", "right"),
            Column("95 % (ms)", "right"),
            Column("largest (ms)", "right"),
        ),
        tuple(rows),
        "Vibrations",
        f"{len(pulses)} pulses commanded, {n_lost} never acknowledged. The source's link answered "
        "within 250 ms.",
    )

"""What `visavis plan` prints: trials in their order, for whom, and the light of what they show."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from rich.table import Table

from visavis.analysis.report.notation import count_of
from visavis.cli.app import console, verbatim
from visavis.lab.config import LabConfig
from visavis.lab.luminance import NO_LUMINANCES
from visavis.protocol.plan.session_plan import SessionPlan, Trial
from visavis.stimuli.dressing.flat import box_px, size_deg
from visavis.stimuli.flat import Dots, Grating, Shape, Text
from visavis.stimuli.scenes.flat import FlatScene
from visavis.stimuli.text_font import missing_characters
from visavis.study.declaration import Study
from visavis.study.experiment import StudyExperiment
from visavis.study.scenes import FLAT
from visavis.study.texts import Texts, label_of

MAX_WORDS: Final = 40
"""Of a text that is named."""
MAX_LINES: Final = 5
"""About what a screen cannot show."""


def luminance_words(lab: LabConfig, experiment: StudyExperiment) -> list[str]:
    """Return what is known of the light of a study's greys and pictures before a monitor."""
    luminance = lab.luminance
    has_greys = any(isinstance(item, Grating | Dots | Shape) for item in experiment.flats)
    if lab.display.on_screen is None:
        return []
    if luminance is None:
        return [NO_LUMINANCES] * has_greys
    lines = [f"greys and contrasts are of light: {luminance.summary}"] * has_greys
    if experiment.pictures or experiment.videos:
        lines.append("pictures and films keep their values, which no table corrects")
    least, greatest = luminance.least_contrast_01, luminance.greatest_contrast_01
    contrasts = sorted({item.contrast_01 for item in experiment.flats if isinstance(item, Grating)})
    faint = ", ".join(f"{c:g}" for c in contrasts if 0.0 < c < least)
    strong = ", ".join(f"{c:g}" for c in contrasts if c > greatest)
    if faint:
        lines.append(
            f"gratings of contrast {faint} are below {least:.3f}, the least of this screen, and "
            "are drawn with that or none, whichever is nearer"
        )
    if strong:
        lines.append(
            f"gratings of contrast {strong} are above {greatest:.3f}, the greatest of this screen, "
            "and are drawn with that"
        )
    return lines


def screen_words(lab: LabConfig, experiment: StudyExperiment) -> list[str]:
    """Return what of a study's stimuli a monitor cannot show: stripes finer than its pixels, and
    what reaches beyond its edges.
    """
    screen, items = lab.display.on_screen, experiment.flats
    if screen is None or not items:
        return []
    flat, lines = screen.flat, []
    most_cycles = flat.width_px / np.degrees(flat.width_m / flat.distance_m) / 2
    fine = sorted({i.cycles_per_deg for i in items if isinstance(i, Grating)})
    too_fine = ", ".join(f"{cycles:g}" for cycles in fine if cycles > most_cycles)
    if too_fine:
        lines.append(
            f"gratings of {too_fine} cycles a degree are finer than the pixels of this screen "
            f"({most_cycles:.3g} at most) and look coarser than they are"
        )
    scene = FlatScene(FLAT, (), folder=experiment.settings.folder)
    for item in items:
        left, top, right, bottom = box_px(item.at_deg, size_deg(item, scene), flat)
        if min(left, top) < 0 or right > flat.width_px or bottom > flat.height_px:
            what = getattr(item, "text", "") or getattr(item, "file", "")
            about = f"{type(item).__name__} {what[:MAX_WORDS]!r}" if what else type(item).__name__
            lines.append(
                f"{about} is {right - left} × {bottom - top} pixels large and reaches beyond the "
                f"screen of {flat.width_px} × {flat.height_px}"
            )
    return lines[:MAX_LINES]


def letter_words(experiment: StudyExperiment, session_plan: SessionPlan) -> list[str]:
    """Return which letters of texts and boards no font has; they are drawn as boxes."""
    lines = []
    texts = [item.text for item in experiment.flats if isinstance(item, Text)]
    if missing := _letters_without_font(texts):
        lines.append(
            f"no font of Visavis has {' '.join(missing)}, which Text shows as boxes; show words "
            "with such letters as an Image"
        )
    boards = [block.instruction for block in session_plan.blocks]
    for words, response in experiment.words.items():
        boards += [words, *map(str, response.options)]
    if missing := _letters_without_font(boards):
        lines.append(
            f"no font of Visavis has {' '.join(missing)}, which boards show as boxes; use "
            "no such letters in questions, answers and instructions"
        )
    return lines


def _letters_without_font(texts: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(c for text in texts for c in missing_characters(text)))


def item_words(experiment: StudyExperiment, session_plan: SessionPlan) -> list[str]:
    """Return how many rows of the study's table this person does not see."""
    table = experiment.item_table
    if table is None:
        return []
    rows_here = {t.factors[table.name] for block in session_plan.blocks for t in block.trials}
    rest = len(table.rows) - len(rows_here)
    if rest <= 0:
        return []
    items = experiment.study.design.items
    why = f"there are no trials for the other {rest}"
    if items is not None and items.lists is not None:
        why = "the others are on other participants' lists, or have no trials"
    return [
        f"{table.file} has {count_of(len(table.rows), 'row')}, of which this person sees "
        f"{len(rows_here)}: {why}"
    ]


def as_operators_read(session_plan: SessionPlan, study: Study) -> SessionPlan:
    """Return a plan without group and the factors between people, where the study is blind."""
    if not study.procedure.blind:
        return session_plan
    between = {factor.name for factor in study.design.factors if factor.between}

    def without_groups(trial: Trial) -> Trial:
        factors = {name: level for name, level in trial.factors.items() if name not in between}
        return replace(trial, factors=factors)

    blocks = (replace(b, trials=tuple(map(without_groups, b.trials))) for b in session_plan.blocks)
    group = study.procedure.shown_group(session_plan.group)
    return replace(session_plan, group=group, blocks=tuple(blocks))


def print_plan(
    session_plan: SessionPlan, label: str, note: str, experiment: StudyExperiment
) -> None:
    """Print the trials of every block in a table, for whom they are, and what comes beside them."""
    criterion, sessions = (
        experiment.study.design.practice_until,
        experiment.study.design.sessions,
    )
    console.print(
        f"[b]{verbatim(session_plan.study)}[/b]  "
        + (f"participant [b]{verbatim(label)}[/b]  " if label else "[b]next new participant[/b]  ")
        + f"place {session_plan.participant_index + 1}  "
        f"seed {session_plan.seed}"
        + (f"  group {session_plan.group}" if session_plan.group else "")
        + (
            f"  session {experiment.session} of {len(sessions)}: "
            f"{verbatim(sessions[experiment.session - 1])}"
            if sessions
            else ""
        )
    )
    if note:
        console.print(f"[yellow]{verbatim(note)}[/]")
    for block in session_plan.blocks:
        calibration = "calibration and validation first" if block.calibrate else ""
        table = Table(title=f"{block.name}  ({calibration})" if calibration else block.name)
        table.title_justify = "left"
        names = list(dict.fromkeys(k for t in block.trials for k in t.factors))
        for name in ("trial", *names):
            # A space lets the table wrap the heading; a cell is folded, never cut off.
            table.add_column(name.replace("_", " "), overflow="fold")
        for trial in block.trials:
            table.add_row(trial.trial_id, *(str(trial.factors.get(n, "")) for n in names))
        console.print(table)
        if block.questionnaires:
            console.print(f"then {', '.join(block.questionnaires)}")
    total = sum(not t.is_practice for t in session_plan.trials)
    practice = len(session_plan.trials) - total
    blocks = sum(any(not t.is_practice for t in b.trials) for b in session_plan.blocks)
    console.print(
        f"{count_of(total, 'trial')} in {count_of(blocks, 'block')}, {practice} practice; then "
        f"{', '.join(session_plan.questionnaires) or 'no questions'}."
    )
    if criterion is not None:
        console.print(verbatim(criterion.words), soft_wrap=True)
    for legend in legends(session_plan, experiment.texts):
        console.print(f"[dim]{verbatim(legend)}[/]", soft_wrap=True)


def legends(session_plan: SessionPlan, texts: Texts) -> Iterator[str]:
    """Yield a line for each factor whose reports use other names for its levels."""
    levels: dict[str, dict[str, None]] = {}
    for trial in session_plan.trials:
        for name, level in trial.factors.items():
            levels.setdefault(name, {})[str(level)] = None
    for name, factor_levels in levels.items():
        level_labels = [
            f"{level} {label}"
            for level in sorted(factor_levels)
            if (label := label_of(texts, level)) != level.replace("_", " ")
        ]
        if level_labels:
            factor_label = label_of(texts, name)
            same = factor_label == name.replace("_", " ")
            yield f"{name}{'' if same else f' ({factor_label})'}: {', '.join(level_labels)}"

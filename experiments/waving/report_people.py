"""The report's section on participants: who they were, how they answered, what was interrupted."""

import numpy as np
import pandas as pd

from analysis.report import Block, Bullets, Column, Fold, Paragraph, Section, Table
from analysis.report.notation import counted, decimal, mean_sd
from experiments.waving.analysis import WavingAnalysis
from experiments.waving.measures import EYE_HEIGHT_TOLERANCE_M

GENDERS = {1: "woman", 2: "man", 3: "another", 4: "not said"}
"""Codes of the demographics questionnaire."""


def people_section(analysis: WavingAnalysis, people: pd.DataFrame) -> Section:
    """Return the section on who took part, and how."""
    blocks: list[Block] = []
    if "age" in people:
        ages = pd.to_numeric(people["age"], errors="coerce").dropna().to_numpy(float)
        if len(ages):
            sd = float(np.std(ages, ddof=1)) if len(ages) > 1 else None
            blocks.append(
                Paragraph(f"Age {mean_sd(float(ages.mean()), sd, 1)} years.{_genders(people)}")
            )
    for column, title in (("strategy", "Strategies named"), ("comment", "Comments")):
        if column in people:
            said = tuple(
                f"{p}: {text}"
                for p, text in zip(people["participant"], people[column], strict=True)
                if isinstance(text, str) and text
            )
            if said:
                blocks.append(Fold(f"{title}: {len(said)}", (Bullets(said),)))
    blocks += _eye_heights(people)
    if analysis.left_out:
        blocks.append(
            Paragraph(f"Without all cells, and so not compared: {', '.join(analysis.left_out)}.")
        )
    how = analysis.analysed["who_by"].value_counts()
    given = ", ".join(f"{name} {count}" for name, count in how.items())
    blocks.append(Paragraph(f"Answers were given by: {given}."))
    done = analysis.trials[~analysis.trials["is_practice"].astype(bool)]
    other = done.loc[done["status"] != "complete", ["participant", "trial_id", "status", "reason"]]
    if len(other):
        rows = tuple(tuple(map(str, r)) for r in other.itertuples(index=False))
        heads = tuple(Column(h) for h in ("Participant", "Trial", "Status", "Reason"))
        blocks.append(Fold("Interrupted and skipped trials", (Table(heads, rows, "Trials"),)))
    return Section("people", "Participants", tuple(blocks))


def _genders(people: pd.DataFrame) -> str:
    """Return how many said which gender, empty where nobody was asked."""
    if "gender" not in people:
        return ""
    said = pd.to_numeric(people["gender"], errors="coerce")
    counts = {name: int((said == code).sum()) for code, name in GENDERS.items()}
    counts["no answer"] = int(said.isna().sum())
    return f" Gender: {', '.join(f'{name} {n}' for name, n in counts.items() if n)}."


def _eye_heights(people: pd.DataFrame) -> list[Block]:
    """Say for whom the warped waves were not made."""
    if "eye_height_m" not in people or not people["eye_height_m"].notna().any():
        return []
    known = people.dropna(subset=["eye_height_m"])
    heights = known["eye_height_m"].to_numpy(float)
    planned = float((known["eye_height_m"] - known["eye_height_off_m"]).iloc[0])
    sd = float(np.std(heights, ddof=1)) if len(heights) > 1 else None
    off = known[known["eye_height_is_off"].astype(bool)]
    text = (
        f"Eye height {mean_sd(float(heights.mean()), sd)} m; waves at the participant were warped "
        f"for {decimal(planned)} m."
    )
    if off.empty:
        text += f" All were within {EYE_HEIGHT_TOLERANCE_M:g} m of it."
        return [Paragraph(text)]
    text += (
        f" {counted(len(off), 'participant')} differed by more than {EYE_HEIGHT_TOLERANCE_M:g} m, "
        "so that warping added other than the planned coverage for them, less for the taller; "
        "their trials are analysed with the others:"
    )
    said = tuple(
        f"{p}: {decimal(height)} m ({'+' if by > 0 else '−'}{decimal(abs(by))} m)"
        for p, height, by in zip(
            off["participant"], off["eye_height_m"], off["eye_height_off_m"], strict=True
        )
    )
    return [Paragraph(text), Bullets(said)]

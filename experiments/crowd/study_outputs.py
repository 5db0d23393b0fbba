"""Write the tables of a crowd study."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.crowd.intake import SessionIntake


def tables_of(sessions: Sequence[SessionIntake]) -> dict[str, pd.DataFrame]:
    """Return the study's tables by name: trials, collisions, crossings, pulses, blocks, people,
    cells.
    """
    trials: list[dict[str, Any]] = []
    collisions: list[dict[str, Any]] = []
    crossings: list[dict[str, Any]] = []
    cells: list[dict[str, Any]] = []
    pulses: list[dict[str, Any]] = []
    for session in sessions:
        for walk in session.walks:
            row = walk.row
            which = {name: row[name] for name in ("participant", "condition", "configuration")}
            trials.append(row)
            collisions += [{**which, **c} for c in walk.collisions]
            crossings += [{**which, **c} for c in walk.crossings]
            cells.append({**which, "trial_id": row["trial_id"], "cells": json.dumps(walk.cells)})
        pulses += [{"participant": session.participant, **p} for p in session.pulses]
    return {
        "trials": pd.DataFrame(trials),
        "collisions": pd.DataFrame(collisions),
        "crossings": pd.DataFrame(crossings),
        "pulses": pd.DataFrame(pulses),
        "blocks": pd.DataFrame([b for s in sessions for b in s.blocks]),
        "people": pd.DataFrame([s.person for s in sessions]),
        "cells": pd.DataFrame(cells),
    }


def analyse_study(sessions: Sequence[SessionIntake], out_dir: Path, *, is_simulated: bool) -> Path:
    """Write every table as CSV and Parquet; return the path of the trials."""
    for name, table in tables_of(sessions).items():
        marked = table.assign(is_simulated=is_simulated)
        marked.to_csv(out_dir / f"{name}.csv", index=False)
        marked.to_parquet(out_dir / f"{name}.parquet", index=False)
    return out_dir / "trials.csv"

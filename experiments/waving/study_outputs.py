"""Write what an analyst takes away of a waving study: tables, figures, report."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.waving.intake import SessionIntake


def analyse_study(sessions: Sequence[SessionIntake], out_dir: Path, *, is_simulated: bool) -> Path:
    """Write every table; return the path of the trials."""
    trials = pd.concat([s.rows for s in sessions], ignore_index=True)
    people = pd.DataFrame([dict(s.person) for s in sessions])
    for name, table in {"trials": trials, "participants": people}.items():
        table.assign(is_simulated=is_simulated).to_csv(out_dir / f"{name}.csv", index=False)
    return out_dir / "trials.csv"

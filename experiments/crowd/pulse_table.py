"""From contact to vibration: delays of every pulse, summarised for the report."""

from typing import Final

import pandas as pd

from analysis.report import Column, Table
from analysis.report.notation import decimal

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
        known = str(len(values))
        if values.empty:
            rows.append((label, known, "–", "–", "–"))
            continue
        rows.append(
            (
                label,
                known,
                decimal(float(values.median()), 2),
                decimal(float(values.quantile(0.95)), 2),
                decimal(float(values.max()), 2),
            )
        )
    lost = int((~pulses["acknowledged"].astype(bool)).sum())
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
        f"{len(pulses)} pulses commanded, {lost} never acknowledged. The source's link answered "
        "within 250 ms.",
    )

"""The report's table of data quality, one row per participant."""

from analysis.report import Column, Table
from analysis.report.notation import decimal, percentage
from experiments.stare.quality_table import (
    DRIFT,
    END_ACCURACY,
    REJECTED,
    SESSION_COLUMNS,
    StareQuality,
)

_SESSION_QUALITY = {
    END_ACCURACY: ("Accuracy at the end (°)", 2),
    DRIFT: ("Drift to the end (°)", 2),
    REJECTED: ("Validations rejected", 0),
}


def quality_table(quality: StareQuality) -> Table:
    """Return accuracy, precision and loss by participant."""
    table = quality.participants
    optional = [(name, *_SESSION_QUALITY[name]) for name in SESSION_COLUMNS if name in table]
    columns = (
        Column("Participant"),
        Column("Accuracy (°)", "right"),
        Column("Worst point (°)", "right"),
        Column("Precision (° RMS-S2S)", "right"),
        Column("Lost gaze", "right"),
        Column("Validations in force", "right"),
        Column("Trials finished", "right"),
        Column("Trials over the limit", "right"),
        *(Column(header, "right") for _, header, _ in optional),
    )
    rows = tuple(
        (
            str(r["participant"]),
            decimal(r["accuracy_deg"], 2),
            decimal(r["worst_point_deg"], 2),
            decimal(r["precision_deg"], 2),
            percentage(r["lost_01"]),
            str(r["calibrations"]),
            str(r["trials"]),
            str(r["trials_out"]),
            *(decimal(r[name], digits) for name, _, digits in optional),
        )
        for r in table.to_dict("records")
    )
    return Table(columns, rows, "Data quality by participant")

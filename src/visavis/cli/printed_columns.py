"""Print a data frame as a table."""

import pandas as pd
from rich.table import Table

from visavis.cli.app import console


def print_columns(title: str, frame: pd.DataFrame, across: str = "") -> None:
    """Print a table; with `across`, turn it by 90° so that wide tables stay readable.

    `across` names the column whose values become the headings.
    """
    columns = {str(name): frame[name].tolist() for name in frame.columns}
    table = Table(title=title, title_justify="left", box=None)
    if across:
        for name in ("", *columns[across]):
            table.add_column(str(name), justify="right" if name else "left")
        for name, values in columns.items():
            if name not in (across, "recording"):
                table.add_row(name, *(_cell_text(v) for v in values))
    else:
        data_columns = {k: v for k, v in columns.items() if k != "recording"}
        for name in data_columns:
            table.add_column(name)
        for row in zip(*data_columns.values(), strict=True):
            table.add_row(*(_cell_text(v) for v in row))
    console.print(table)


def _cell_text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)

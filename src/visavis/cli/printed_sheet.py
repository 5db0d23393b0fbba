"""Print the privacy sheet of an export."""

from rich.table import Table

from visavis.cli.app import console, say, say_plainly, verbatim
from visavis.recording.privacy_sheet import MIN_PEOPLE, PrivacySheet


def print_sheet(sheet: PrivacySheet) -> None:
    """Print what leaves, a line each, then what in it tells who somebody is."""
    table = Table(box=None, pad_edge=False)
    for name in ("where", "what", "class", "values", "for example"):
        table.add_column(name, justify="right" if name == "values" else "left")
    for line in sheet.lines:
        texts = (line.where, line.name, line.kind, str(line.values), " | ".join(line.examples))
        table.add_row(*map(verbatim, texts))
    console.print(table)
    for finding in sheet.findings:
        say_plainly(f"! {finding}", style="bold red")
    if sheet.rare:
        say(f"[yellow]what fewer than {MIN_PEOPLE} people say of themselves:[/]")
        for combination in sheet.rare:
            say_plainly(f"  {combination}", style="yellow")
    if not sheet.findings:
        say("no e-mail address, telephone number or name of the ledger was found in what leaves")

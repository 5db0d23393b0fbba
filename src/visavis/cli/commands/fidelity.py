"""fidelity: what the source of a study says, beside what the study does."""

from dataclasses import asdict
from typing import Annotated

import typer
from rich.table import Table

from visavis.cli.app import (
    ConfigOption,
    JsonOption,
    StudyArgument,
    app,
    console,
    load_lab,
    say,
    say_json,
)
from visavis.cli.commands.session import SetOption
from visavis.lab.errors import UsageError
from visavis.results.fidelity import (
    HEADINGS,
    KINDS,
    counts_of,
    fidelity_markdown,
    fidelity_rows,
    stale_facts,
)
from visavis.results.opened_study import find_study
from visavis.running.sessions.study_folder import read_parameters


@app.command()
def fidelity(
    study: StudyArgument,
    assignments: SetOption = None,
    is_markdown: Annotated[
        bool, typer.Option("--markdown", help="Print Markdown, for a README or a supplement.")
    ] = False,
    is_json: JsonOption = False,
    config: ConfigOption = None,
) -> None:
    """Show what a study's source says beside what the study does: same, stronger or different.

    Design, procedure, measures, tests and printed results, made from what the study declares of its
    source; numbers that the design has are compared, printed results and orders are not. Exits with
    1 where a difference has no reason, or a reason is given for what is no difference.

    Example: visavis fidelity stare
    """
    lab = load_lab(config, "sim", only_simulates=True, quiet=is_json or is_markdown)
    opened_study = find_study(study, lab.studies)
    experiment = opened_study.experiment(read_parameters(list(assignments or ())))
    source = opened_study.study.report.source
    rows = fidelity_rows(experiment)
    if source is None or not rows:
        raise UsageError(
            f"study {opened_study.name} declares no source; where it repeats a publication, name "
            'that and what it says: source=Source("citation", facts=[Fact(…)])'
        )
    problems = [
        *(f"{row.what}: different, and no reason is declared" for row in rows if row.lacks_reason),
        *(
            f"{what}: a reason is declared, and nothing is different"
            for what in stale_facts(experiment)
        ),
    ]
    if is_json:
        say_json({"source": source.citation, "rows": [asdict(row) for row in rows]})
    elif is_markdown:
        typer.echo(fidelity_markdown(rows), nl=False)
    else:
        say(f"{opened_study.title}, beside {source.citation}")
        for kind, heading in KINDS.items():
            table = Table(heading, *HEADINGS[1:], expand=True)
            for row in (r for r in rows if r.kind == kind):
                table.add_row(row.what, row.printed, row.where, row.here, row.verdict_text)
            if table.row_count:
                console.print(table)
        say(counts_of(rows))
    for problem in problems:
        typer.echo(problem, err=True)
    if problems:
        raise typer.Exit(1)

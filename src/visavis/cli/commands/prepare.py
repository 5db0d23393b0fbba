"""prepare: compute in advance what a study needs before its first trial."""

from visavis.cli.app import ConfigOption, StudyArgument, app, console, load_lab, verbatim
from visavis.cli.commands.session import SetOption
from visavis.cli.notifier import make_ready
from visavis.cli.studies import study_here
from visavis.lab.clock import StopWatch


@app.command()
def prepare(
    study: StudyArgument, config: ConfigOption = None, assignments: SetOption = None
) -> None:
    """Compute what a study needs beforehand, such as the evening before.

    run does what is left of it before the first trial. What takes long is kept in your cache
    folder; a few trials are rehearsed unseen, so that all code is compiled.

    Example: visavis prepare waving
    """
    watch = StopWatch()
    lab = load_lab(config, only_simulates=True)
    here = study_here(study, lab)
    requested_settings = here.requested_settings(assignments=assignments)
    experiment = here.study.experiment_to_run(requested_settings.parameters)
    make_ready(here.study, experiment, lab)
    console.print(f"[b]{verbatim(here.study.name)}[/] is ready after {watch.elapsed_s():.0f} s")

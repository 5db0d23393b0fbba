"""prepare: what a study computes before its first trial, done beforehand."""

from cli.app import ConfigOption, StudyArgument, app, console, load_lab, verbatim
from cli.commands.session import SetOption
from cli.getting_ready import make_ready
from cli.studies import study_of_lab
from lab.clock import StopWatch
from recording.folder import study_dir
from visavis.sessions.rig import is_simulated
from visavis.sessions.study_folder import wanted_settings


@app.command()
def prepare(
    study: StudyArgument, config: ConfigOption = None, assignments: SetOption = None
) -> None:
    """Compute what a study needs beforehand, such as the evening before.

    run does what is left of it before the first trial. What takes long is kept in your cache
    folder.

    Example: visavis prepare waving
    """
    watch = StopWatch()
    lab = load_lab(config, only_simulates=True)
    chosen = study_of_lab(study, lab)
    simulated = is_simulated(lab)
    folder = study_dir(lab.data_root, chosen.name, is_simulated=simulated)
    wanted = wanted_settings(
        folder, chosen, is_simulated=simulated, assignments=assignments, language=lab.language
    )
    make_ready(chosen.experiment(wanted.parameters))
    console.print(f"[b]{verbatim(chosen.name)}[/] is ready after {watch.elapsed_s():.0f} s")

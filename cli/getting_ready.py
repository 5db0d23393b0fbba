"""Do what would hold up a frame before anything is shown, behind a progress bar."""

from cli.telling import TELLING
from protocol.experiment import Experiment, Preparing


def make_ready(experiment: Experiment) -> None:
    """Load and compute what an experiment needs; what is there already takes no time."""
    if not isinstance(experiment, Preparing):
        return
    with TELLING.progress(f"getting {experiment.name} ready") as told:
        experiment.prepare(told)

"""Two people of a short stare study, as `visavis simulate` makes them."""

from pathlib import Path

from typer.testing import CliRunner

from tests.sessions import SHORT_STARE
from tests.store import STORE
from visavis.cli.main import app

TWO = ["simulate", "stare", "--participants", "2", "--seed", "5", *SHORT_STARE]


def simulate(root: Path, *more: str) -> Path:
    """Simulate the study below a folder; return where it lies."""
    words = [*TWO, "--output", str(root), "--processes", "1", *more]
    result = CliRunner().invoke(app, words)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return root / "simulated" / "stare"


def two_of_stare(root: Path) -> Path:
    """Return a copy of the study, which is simulated once in a run of the suite."""
    return STORE.copy("two of stare", simulate, root)


def analysed_two_of_stare(root: Path) -> Path:
    """Return a copy of the study with its report, which is written once in a run of the suite."""

    def analyse(folder: Path) -> Path:
        study = two_of_stare(folder)
        result = CliRunner().invoke(app, ["analyse", str(study), "--processes", "1"])
        assert result.exit_code == 0, result.output
        return study

    return STORE.copy("analysed two of stare", analyse, root)

"""A study file that is simulated before a screen and analysed."""

from pathlib import Path

from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.lab.config_files import SCREEN_EXAMPLE


def simulate_and_analyse(file: Path, text: str, *more: str, participants: int) -> Path:
    """Write a study file, let people perform it, and return the folder of the analysed study.

    `more` are further words of `visavis simulate`.
    """
    file.write_text(text, "utf-8")
    words = ["simulate", str(file), "--participants", str(participants), "--processes=1"]
    words += ["--output", str(file.parent), "--config", str(SCREEN_EXAMPLE), *more]
    result = CliRunner().invoke(app, words)
    assert 0 == result.exit_code, result.output
    folder = file.parent / "simulated" / file.stem
    result = CliRunner().invoke(app, ["analyse", str(folder), "--processes", "1"])
    assert 0 == result.exit_code, result.output
    return folder

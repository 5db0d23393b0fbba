"""Who came to a served study is found by the commands beside it, whatever the lab's devices are."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.cli.studies import people_here
from visavis.devices.registry import OPTION_MODELS
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.people.ledger import Ledger

ON_PAGE = """
from visavis import Factor, Rating, Study
study = Study("lively", factors=[Factor("load", ["low", "high"])], on="browser")
@study.trial
def trial(t):
    yield t.ask(Rating("nice"))
"""
IN_LAB = ON_PAGE.replace('on="browser"', "uses=[], calibrate=False")


@pytest.fixture
def lab(tmp_path: Path) -> LabConfig:
    """Return a laboratory as init leaves it: every device is simulated."""
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    return load_config(tmp_path / "lab_config.yaml", OPTION_MODELS)


def ledger(lab: LabConfig, kind: str) -> Ledger:
    prefix = "S" if kind == "simulated" else ""
    return Ledger(lab.data_root / kind / "lively", SystemClock(), prefix=prefix)


@pytest.mark.parametrize(
    ("text", "ledgers", "devices", "kind"),
    [
        (ON_PAGE, [], None, "real"),
        (ON_PAGE, ["real"], None, "real"),
        (ON_PAGE, ["simulated"], None, "simulated"),
        (ON_PAGE, ["real", "simulated"], None, "real"),
        (ON_PAGE, ["real"], "sim", "simulated"),
        (IN_LAB, [], None, "simulated"),
        (IN_LAB, ["real"], None, "real"),
        (IN_LAB, ["real", "simulated"], None, "simulated"),
    ],
)
def test_people_are_looked_for_where_they_are(
    lab: LabConfig, tmp_path: Path, text: str, ledgers: list[str], devices: str | None, kind: str
) -> None:
    (tmp_path / "lively.py").write_text(text, "utf-8")
    for one in ledgers:
        ledger(lab, one).add()
    here = people_here(str(tmp_path / "lively.py"), lab, devices)
    assert lab.data_root / kind / "lively" == here.folder


def test_who_came_to_a_page_can_be_listed_and_withdrawn(lab: LabConfig, tmp_path: Path) -> None:
    file = tmp_path / "lively.py"
    file.write_text(ON_PAGE, "utf-8")
    label = ledger(lab, "real").add().label
    config = ["--config", str(tmp_path / "lab_config.yaml")]
    for command in (["board", str(file)], ["participant", "list", str(file)]):
        assert label in CliRunner().invoke(app, [*command, *config]).output
    withdraw = ["participant", "withdraw", str(file), label, "--yes", *config]
    assert f"{label} is withdrawn" in CliRunner().invoke(app, withdraw).output
    assert ["withdrawn"] == [entry.status for entry in ledger(lab, "real").list()]

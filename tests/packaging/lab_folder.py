"""A laboratory's folder whose own files have the names of rooms of Visavis."""

from pathlib import Path

OWN_MODULES = ("cli", "devices", "experiments", "recording")
OWN_PACKAGES = ("lab", "protocol", "stimuli")
OWN_FOLDERS = ("analysis", "stage", "study", "people", "results", "running")
"""Folders without Python: pictures, notes."""
SCRIPT = """
import analysis, cli, devices, experiments, lab, protocol, recording, stimuli
import visavis
import visavis.analysis, visavis.cli, visavis.devices, visavis.experiments, visavis.stimuli

assert "ours" == lab.WHOSE == stimuli.WHOSE == protocol.WHOSE
assert "ours" == cli.WHOSE == devices.WHOSE == experiments.WHOSE == recording.WHOSE
assert not hasattr(analysis, "gaze")
print(visavis.Study.__module__, visavis.gaze.__name__)
"""
TEST = """
import analysis, devices, lab
import visavis.devices
from visavis.testing import check_study

def test_the_study_can_be_run():
    assert "ours" == devices.WHOSE == lab.WHOSE
    check_study("./duel.py")
"""
TYPED = """
import visavis

data = visavis.open_study(3)
reveal_type(data.path)
visavis.Study("mood", factors=[visavis.Factor("eyes", ["a", "b"])], practise=1)
"""


def fill_lab_folder(folder: Path) -> None:
    """Write modules, packages and folders named like rooms of Visavis, a script and a test."""
    for name in OWN_MODULES:
        (folder / f"{name}.py").write_text('WHOSE = "ours"\n', "utf-8")
    for name in (*OWN_PACKAGES, *OWN_FOLDERS):
        (folder / name).mkdir()
        (folder / name / "notes.txt").write_text("ours\n", "utf-8")
    for name in OWN_PACKAGES:
        (folder / name / "__init__.py").write_text('WHOSE = "ours"\n', "utf-8")
    (folder / "script.py").write_text(SCRIPT, "utf-8")
    (folder / "test_duel.py").write_text(TEST, "utf-8")
    (folder / "typed.py").write_text(TYPED, "utf-8")

"""A belt of the page and an LSL stream land in recording, check, report, quality page and BIDS."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.commands import COMMANDS
from tests.devices.test_add_a_device_page import ROOT, package
from tests.sessions import STUDIES
from visavis.lab.config_files import EXAMPLE
from visavis.recording.reader import Recording

__all__ = ["package"]

OWN = """devices:
  heart_belt: {driver: heart_belt, simulated: true}
  eeg: {driver: lsl_stream, simulated: true, channels: [Fz, Cz, Pz, Oz], rate_hz: 128.0}
"""


@pytest.fixture(scope="module")
def here(package):
    """Return the folder of a lab whose package adds the belt, after one session of a study."""
    shutil.copytree(STUDIES / "texts", package / "texts")
    shutil.copy(STUDIES / "duel.py", package / "duel.py")
    written = EXAMPLE.read_text("utf-8").replace("devices:\n", OWN, 1)
    (package / "lab_config.yaml").write_text(written)
    said(
        package,
        "run",
        "./duel.py",
        "--participant",
        "1",
        "--fast",
        "--devices",
        "sim",
        "--set",
        "repetitions=1",
        "--set",
        "practice=0",
    )
    return package


def said(folder, *arguments):
    path = os.pathsep.join((str(folder), str(ROOT)))
    process = COMMANDS.run(
        *["-m", "visavis.cli.main", *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": path},
        timeout=280,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def session(here):
    return next((here / "data").rglob("ses-001"))


def test_streams_are_recorded_with_their_columns_and_units(session):
    recording = Recording(session)
    belt, eeg = (recording.stream_schema(name) for name in ("heart_belt", "eeg"))
    assert [(f.name, f.unit) for f in belt.fields] == [
        ("heart_rate", "{beats}/min"),
        ("interval_ms", "ms"),
    ]
    assert [(f.name, f.unit) for f in eeg.fields] == [(c, "uV") for c in ("fz", "cz", "pz", "oz")]
    arrays = recording.stream_arrays("heart_belt")
    assert np.diff(arrays["seq"]).tolist() == [1] * (len(arrays["seq"]) - 1)
    assert np.diff(arrays["t_device_ns"]).tolist() == [10**9] * (len(arrays["seq"]) - 1)
    assert 60 < arrays["heart_rate"].mean() < 76


def test_check_counts_their_samples(here):
    text = said(here, "check", "./duel.py", "--participant", "1")
    assert re.search(r"heart_belt +\d+ +\d+ +1\.0 Hz", text)
    assert re.search(r"eeg +\d+ +\d+ +128\.0 Hz", text)


def test_quality_page_shows_them(here, session):
    text = said(here, "quality", str(session), "-o", "quality")
    assert re.search(r"heart_belt +\d+ samples, 1\.0 Hz", text)
    page = (here / "quality" / "gaze_quality.html").read_text("utf-8")
    assert "heart_belt of S01" in page
    assert "{beats}/min" in page


def test_quality_of_a_study_is_that_of_its_session_begun_last(here, session):
    said(here, "quality", "./duel.py", "-o", "of_study")
    assert "heart_belt of S01" in (here / "of_study" / "gaze_quality.html").read_text("utf-8")


def test_report_shows_them(here, session):
    said(here, "analyse", str(session.parents[1]))
    report = next((here / "data").rglob("report.html")).read_text("utf-8")
    for told in ("Devices of the lab's own", "heart_belt", "{beats}/min", "eeg of S01"):
        assert told.replace("'", "&#x27;") in report or told in report, told
    assert list((here / "data").rglob("stream_heart_belt_*.svg"))


def test_bids_has_them_and_is_valid(here, session):
    said(here, "export", str(session), "--format", "bids", "-o", "bids", "--keep-label")
    notes = json.loads(next((here / "bids").rglob("*_recording-heartbelt_physio.json")).read_text())
    table = pd.read_csv(
        next((here / "bids").rglob("*_recording-heartbelt_physio.tsv.gz")),
        sep="\t",
        names=notes["Columns"],
    )
    assert notes["SamplingFrequency"] == 1.0
    assert notes["heart_rate"]["Units"] == "{beats}/min"
    assert notes["Manufacturer"] == "Example"
    assert table["interval_ms"].between(700, 1100).all()
    assert next((here / "bids").rglob("*_recording-eeg_physio.tsv.gz"))
    validator = Path(sys.executable).with_name("bids-validator-deno")
    done = subprocess.run(
        [str(validator), "--json", str(here / "bids")], capture_output=True, text=True
    )
    issues = json.loads(done.stdout)["issues"]["issues"]
    assert [i["code"] for i in issues if i["severity"] == "error"] == []

"""A withdrawal says what it cannot reach, of any session and of this one."""

from dataclasses import replace
from pathlib import Path

import pytest

from tests.recording.sessions import new_recorder, probe_manifest
from visavis.cli.places_of_a_person import ALWAYS_BEYOND, LSL_EVENT, out_of_reach
from visavis.lab.clock import SimClock
from visavis.recording.folder import create_session
from visavis.running.page.other_hosts.results import IMPORT_KEY


@pytest.mark.parametrize(
    ("configuration", "event", "words"),
    [
        ({IMPORT_KEY: {"run": "x"}}, "pause_start", "delete its run in JATOS"),
        ({"on": "browser"}, "pause_start", "that browser keeps what it had not sent"),
        ({}, LSL_EVENT, "delete its XDF file"),
        ({}, "pause_start", ""),
    ],
)
def test_what_lies_elsewhere_is_named(
    configuration: dict[str, object], event: str, words: str, tmp_path: Path
) -> None:
    clock = SimClock()
    manifest = replace(probe_manifest(), configuration=configuration, configuration_sha256="")
    with create_session(tmp_path, manifest) as folder:
        recorder = new_recorder(folder, clock)
        recorder.event(event, 0)
        folder.end_part(clock, recorder.close("complete"))
    lines = out_of_reach([folder.path])
    assert ALWAYS_BEYOND == lines[-3:]
    assert (words in lines[0]) if words else len(ALWAYS_BEYOND) == len(lines)


def test_a_damaged_session_is_withdrawn_all_the_same(tmp_path: Path) -> None:
    assert ALWAYS_BEYOND == out_of_reach([tmp_path / "sub-01B" / "ses-001"])

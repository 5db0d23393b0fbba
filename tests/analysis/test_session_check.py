"""What check says of a session can be acted on: numbers are told, not replaced by dots."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.recording.sessions import new_recorder, probe_manifest
from visavis.analysis.session_check import check_session, drift_words, in_one, stream_findings
from visavis.analysis.session_verdict import Level, StreamCheck
from visavis.devices.contracts import FRAME_TIMING
from visavis.lab.clock import NS_PER_S, SimClock
from visavis.lab.schema import SampleBatch
from visavis.protocol.session.streams import FRAMES
from visavis.recording.folder import create_session
from visavis.recording.reader import Recording

Event = tuple[str, dict[str, Any]]


def said_of(
    root: Path, subject: str, *events: Event, configuration: Mapping[str, Any] | None = None
) -> list[tuple[Level, str]]:
    """Return what check says about a subject of a session in which these events happened."""
    clock = SimClock()
    plan = {"blocks": [], "questionnaires": ["scale"]}
    manifest = replace(probe_manifest(), plan=plan, configuration=configuration or {})
    with create_session(root, manifest) as folder:
        recorder = new_recorder(folder, clock)
        for t_ns, (name, payload) in enumerate(events):
            recorder.event(name, t_ns, **payload)
        folder.end_part(clock, recorder.close("complete"))
    findings = check_session(Recording(folder.path)).findings
    return [(f.level, f.message) for f in findings if f.subject == subject]


def fault(role: str, message: str) -> Event:
    return "fault", {"role": role, "message": message, "severity": "warning", "remedy": ""}


def operator(action: str, **more: Any) -> Event:
    return "operator", {"action": action, "text": None, **more}


CALIBRATED: Event = ("calibration", {"succeeded": True, "message": ""})
NOT_CALIBRATED: Event = ("calibration", {"succeeded": False, "message": "the eyes were shut"})


@pytest.mark.parametrize(
    ("expected", "messages"),
    [
        ([], []),
        (["silent for 20 ms"], ["silent for 20 ms"]),
        (["silent for 9 to 20 ms (2 times)"], ["silent for 20 ms", "silent for 9 ms"]),
        (["silent for 7 ms (3 times)"], ["silent for 7 ms"] * 3),
        (["silent for 7 ms", "away (2 times)"], ["silent for 7 ms", "away", "away"]),
    ],
    ids=["never", "once", "twice", "the same three times", "two kinds"],
)
def test_a_fault_that_came_again_says_how_often(
    expected: list[str], messages: list[str], tmp_path: Path
) -> None:
    others = fault("armband", "silent for 5 ms")
    events = [others, *(fault("eye_tracker", message) for message in messages)]
    amber = [(Level.AMBER, message) for message in expected]
    assert amber == said_of(tmp_path, "eye_tracker", *events)


def test_faults_before_the_first_calibration_are_not_counted(tmp_path: Path) -> None:
    silent = fault("eye_tracker", "silent for 7 ms")
    found = said_of(tmp_path, "eye_tracker", silent, CALIBRATED, silent, CALIBRATED, silent)
    assert [(Level.AMBER, "silent for 7 ms (2 times)")] == found


@pytest.mark.parametrize(
    ("expected", "subject", "events"),
    [
        ("pauses: 2", "deviation", [("pause_start", {})] * 2),
        (
            "blocks run on a calibration below the threshold: 2",
            "deviation",
            [("calibration_below_threshold", {})] * 2,
        ),
        ("moments flagged by the operator: 2", "flag", [operator("flag"), operator("note")] * 2),
        (
            "given by the operator: a device did not work (device) once; "
            "the participant is unwell (unwell) 2 times",
            "reasons",
            [operator("pause", code=code) for code in ("unwell", "device", "unwell")],
        ),
        (
            "scale: 2 left out",
            "questionnaires",
            [
                ("answer", {"questionnaire": "scale", "question": str(i), "answer": answer})
                for i, answer in enumerate((None, 3, None))
            ],
        ),
        (
            "was away for 2.5 s, then came back",
            "armband",
            [("device_back", {"role": "armband", "away_s": 2.5})],
        ),
        (
            "the operator went on without it; trials are flagged",
            "armband",
            [("device_done_without", {"role": "armband"})] * 2,
        ),
        (
            "repeated on the operator's request: T1, T2",
            "trials",
            [("trial_repeat", {"trial_id": name}) for name in ("T1", "T2")],
        ),
    ],
)
def test_what_happened_more_than_once_is_counted(
    expected: str, subject: str, events: list[Event], tmp_path: Path
) -> None:
    assert 1 == [message for _, message in said_of(tmp_path, subject, *events)].count(expected)


def test_calibrations_that_failed_are_counted_with_the_last_reason(tmp_path: Path) -> None:
    events = (NOT_CALIBRATED, CALIBRATED, NOT_CALIBRATED)
    found = said_of(tmp_path, "calibration", *events)
    assert (Level.AMBER, "calibrations that failed: 2; the eyes were shut") in found


@pytest.mark.parametrize(
    ("expected", "on"),
    [([(Level.RED, "no validation was recorded")], "lab"), ([], "browser")],
)
def test_nobody_is_to_calibrate_on_a_page(
    expected: list[tuple[Level, str]], on: str, tmp_path: Path
) -> None:
    assert expected == said_of(tmp_path, "calibration", configuration={"on": on})


@pytest.mark.parametrize(
    ("expected", "messages"),
    [
        ("no data for 120 ms", ["no data for 120 ms"]),
        ("silent for 9 to 120 ms", ["silent for 20 ms", "silent for 120 ms", "silent for 9 ms"]),
        ("7 dropped of 10 to 12.5", ["7 dropped of 12.5", "7 dropped of 10"]),
        ("the left eye is not seen", ["the left eye is not seen"] * 3),
    ],
)
def test_messages_that_differ_in_numbers_are_told_with_their_range(
    expected: str, messages: list[str]
) -> None:
    assert expected == in_one(messages)


def test_streams_that_lack_the_same_are_told_once() -> None:
    few = [
        StreamCheck(name, 940, 1000, 84.6, 111.2, Level.AMBER)
        for name in ("head", "frame_timing", "frames")
    ]
    gaze = StreamCheck("gaze", 700, 1000, 84.0, 320.0, Level.RED)
    whole = StreamCheck("responses", 0, None, None, None, Level.GREEN)

    assert [
        ("head", "94 % of the expected samples, longest gap 111 ms; so frame_timing, frames"),
        ("gaze", "70 % of the expected samples, longest gap 320 ms"),
    ] == [(f.subject, f.message) for f in stream_findings([*few, gaze, whole])]


@pytest.mark.parametrize(
    ("expected", "start_deg", "end_deg"),
    [
        (", 0.22° better than before the last block", 1.02, 0.80),
        (", 0.50° worse than before the last block", 0.5, 1.0),
        (", as before the last block", 0.8, 0.801),
        ("", None, 0.8),
    ],
)
def test_a_change_of_accuracy_is_told_without_a_sign_to_interpret(
    expected: str, start_deg: float | None, end_deg: float
) -> None:
    assert expected == drift_words(start_deg, end_deg)


def frames_of(root: Path, begun_ns: Any, flags: int = 0) -> list[str]:
    """Return what check says of frames of a display of 90 Hz that began at these times."""
    clock = SimClock()
    n = np.arange(len(begun_ns))
    account = np.zeros(len(n), FRAME_TIMING.dtype)
    account["timing_known"], account["presents"], account["reprojection_flags"] = True, 1, flags
    with create_session(root, probe_manifest()) as folder:
        recorder = new_recorder(folder, clock)
        for schema, values in (
            (replace(FRAMES, nominal_rate_hz=90.0), np.zeros(len(n), FRAMES.dtype)),
            (FRAME_TIMING, account),
        ):
            recorder.declare(schema)
            recorder.append(SampleBatch(schema, n, begun_ns, begun_ns, values))
        folder.end_part(clock, recorder.close("complete"))
    findings = check_session(Recording(folder.path)).findings
    return [f.message for f in findings if f.subject == "pace"]


FRAME_NS = NS_PER_S // 90


def test_a_runtime_that_halved_its_rate_or_reprojected_is_told_of_a_session(
    tmp_path: Path,
) -> None:
    regular_ns = FRAME_NS * np.arange(300)
    assert [] == frames_of(tmp_path / "kept", regular_ns)
    (halved,) = frames_of(tmp_path / "halved", 2 * regular_ns)
    assert "halved its rate in 100% of frames: a mark's light is up to a frame later" in halved
    (again,) = frames_of(tmp_path / "again", regular_ns, flags=0b10)
    assert "showed 100% of frames again" in again

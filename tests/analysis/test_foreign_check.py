"""Recordings made elsewhere: each fault of their times is named by stream, with what to do."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.recording.test_export import gaze_session
from visavis.analysis.foreign_check import StreamVerdict, check_foreign
from visavis.analysis.session_verdict import Level
from visavis.cli.main import app
from visavis.lab.errors import DataError
from visavis.recording.bids import export_bids
from visavis.recording.xdf import XdfStream, XdfWriter

REGULAR = np.arange(1000) / 100


def written(
    path: Path,
    *streams: tuple[str, np.ndarray, Sequence[tuple[float, float]]],
    rate_hz: float = 100,
) -> Path:
    with path.open("wb") as file:
        writer = XdfWriter(file)
        for number, (name, stamps, offsets) in enumerate(streams, start=1):
            writer.begin(XdfStream(number, name, "x", rate_hz, "double64", 2, "s"), {})
            writer.samples(number, stamps, np.zeros((len(stamps), 2)))
            for at, by in offsets:
                writer.clock_offset(number, at, by)
            writer.finish(number)
    return path


def of(verdicts: tuple[StreamVerdict, ...], name: str) -> StreamVerdict:
    return next(v for v in verdicts if v.name == name)


OFFSETS = [(0.0, 0.0), (5.0, 0.0)]


def test_a_sound_file_is_green(tmp_path: Path) -> None:
    findings = check_foreign(written(tmp_path / "a.xdf", ("gaze", REGULAR, OFFSETS)))
    assert [("gaze", 1000, Level.GREEN, ())] == [
        (v.name, v.samples, v.level, v.findings) for v in findings
    ]


@pytest.mark.parametrize(
    ("stamps", "level", "text"),
    [
        (np.delete(REGULAR, slice(300, 500)), Level.RED, "1 gaps, the longest 2.010 s"),
        (np.delete(REGULAR, slice(300, 310)), Level.AMBER, "1 gaps, the longest 0.110 s"),
        (np.concatenate([REGULAR[:500], REGULAR[500:] - 0.1]), Level.RED, "go back 1 times, by up"),
        (REGULAR * 1.1, Level.RED, "90.91 Hz instead of 100 Hz"),
        (REGULAR * 1.02, Level.AMBER, "98.04 Hz instead of 100 Hz"),
    ],
)
def test_a_fault_of_times_is_named(
    stamps: np.ndarray, level: Level, text: str, tmp_path: Path
) -> None:
    (findings,) = check_foreign(written(tmp_path / "a.xdf", ("gaze", stamps, OFFSETS)))
    assert level is findings.level
    assert any(text in what for what, _ in findings.findings)


def test_a_stream_without_offsets_and_one_beside_the_others_are_named(tmp_path: Path) -> None:
    other_clock = REGULAR + 90_000
    path = written(
        tmp_path / "a.xdf",
        ("gaze", REGULAR, OFFSETS),
        ("head", REGULAR, OFFSETS),
        ("body", other_clock, ()),
        ("belt", other_clock, [(90_000.0, -90_000.0)]),
    )
    findings = check_foreign(path)
    texts = [what for what, _ in of(findings, "body").findings]
    assert "no clock offset" in texts
    assert any("does not overlap the others" in what for what in texts)
    assert Level.RED is of(findings, "body").level
    assert Level.GREEN is of(findings, "belt").level


def test_a_cut_or_foreign_file_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.xdf", ("gaze", REGULAR, OFFSETS))
    whole = path.read_bytes()
    path.write_bytes(whole[:9000])
    (findings,) = check_foreign(path)
    assert "cut at byte 9000" in findings.findings[0][0]
    path.write_bytes(whole[:20])
    with pytest.raises(DataError, match="cannot be read as XDF"):
        check_foreign(path)
    path.write_bytes(b"RIFF")
    with pytest.raises(DataError, match="does not begin with XDF"):
        check_foreign(path)


def test_the_command_judges_a_bids_data_set(tmp_path: Path) -> None:
    export_bids([gaze_session(tmp_path / "d")], tmp_path / "b", task="stare", dataset_name="Stare")
    result = CliRunner().invoke(app, ["check", str(tmp_path / "b")])
    assert 0 == result.exit_code, result.output
    assert 4 == result.output.count("nothing wrong with its times")

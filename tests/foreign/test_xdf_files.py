"""XDF as recorders leave it: resets, cuts, damage and missing exchanges are told."""

import gzip
import io
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import pyxdf
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from visavis.analysis.foreign_check import StreamVerdict, check_foreign, read_xdf_times
from visavis.analysis.session_verdict import Level
from visavis.analysis.xdf_times import BOUNDARY
from visavis.recording.xdf import XdfStream, XdfWriter

FILES = Path(__file__).parent / "files" / "xdf"
Times = npt.NDArray[np.float64]
Exchanges = Sequence[tuple[float, float]]


def file_of(
    *streams: tuple[str, Times, Exchanges], rate_hz: float = 50, per_chunk: int = 10**9
) -> bytes:
    """An XDF file; samples and exchanges in chunks, a boundary chunk after each."""
    file = io.BytesIO()
    writer = XdfWriter(file)

    def boundary() -> None:
        file.write(struct.pack("<BBH", 1, 18, 5) + BOUNDARY)

    for number, (name, own_s, exchanges) in enumerate(streams, start=1):
        writer.begin(XdfStream(number, name, "Gaze", rate_hz, "double64", 1, name), {})
        for start in range(0, len(own_s), per_chunk):
            part = own_s[start : start + per_chunk]
            writer.samples(number, part, np.zeros((len(part), 1)))
            boundary()
        for at_s, by_s in exchanges:
            writer.clock_offset(number, at_s, by_s)
    return file.getvalue()


def judged(path: Path, content: bytes) -> tuple[StreamVerdict, ...]:
    path.write_bytes(content)
    return check_foreign(path)


def words(verdict: StreamVerdict) -> str:
    return "; ".join(what for what, _ in verdict.findings)


# ---- the files ---------------------------------------------------------------------------------


def test_a_clock_reset_is_named_and_both_parts_are_mapped_by_their_own_offsets() -> None:
    path = FILES / "clock_reset.xdf"
    (verdict,) = check_foreign(path)
    assert (Level.AMBER, pytest.approx(50, abs=0.01)) == (verdict.level, verdict.rate_hz)
    assert "clock was reset before sample 1500, after a pause of 100.0 s" == words(
        verdict
    ).removeprefix("its ")
    (stream,) = read_xdf_times(path)
    (theirs,), _ = pyxdf.load_xdf(str(path), dejitter_timestamps=False)
    assert np.abs(theirs["time_stamps"] - stream.stamps_s).max() < 1e-3


def test_a_file_cut_by_a_crash_is_read_up_to_the_cut() -> None:
    (verdict,) = check_foreign(FILES / "cut_by_a_crash.xdf")
    (theirs,), _ = pyxdf.load_xdf(str(FILES / "cut_by_a_crash.xdf"))
    assert (1250, 1250) == (verdict.samples, len(theirs["time_stamps"]))
    assert f"cut at byte {(FILES / 'cut_by_a_crash.xdf').stat().st_size}" in words(verdict)


def test_a_header_in_latin_1_is_read() -> None:
    (verdict,) = check_foreign(FILES / "latin1_unit.xdf")
    assert (Level.GREEN, 1500) == (verdict.level, verdict.samples)


def test_streams_700_000_s_apart_are_told_with_the_one_without_offsets() -> None:
    eeg, gaze = check_foreign(FILES / "apart.xdf")
    assert "off by 700 000 s" in words(eeg)
    assert "no clock offset" in words(eeg)
    assert "does not overlap EEG, which has no clock offset: off by -700 000 s" == words(gaze)


def test_exchanges_that_end_early_are_told_with_how_far_drift_has_gone(tmp_path: Path) -> None:
    host_s = 1000 + np.arange(36_000) / 10
    own_s = 1000 + (host_s - 1000) / (1 + 200e-6)
    early = [(t, (t - 1000) * 200e-6) for t in np.arange(1000.0, 1600.0, 5)]
    whole = [(t, 0.0) for t in np.arange(1000.0, 4600.0, 60)]
    content = file_of(("eeg", own_s, early), ("gaze", host_s, whole), rate_hz=10)
    eeg, gaze = judged(tmp_path / "a.xdf", content)
    assert "50 of 60 min have no clock exchange; at 200 ppm its clock goes off by 0.60 s" in words(
        eeg
    )
    assert Level.GREEN is gaze.level
    mapped = read_xdf_times(tmp_path / "a.xdf")[0].stamps_s
    assert np.abs(mapped - host_s).max() < 1e-3  # along the line, not half a second behind


# ---- further members of the kinds --------------------------------------------------------------


PART_S = 100.0


@settings(max_examples=20, deadline=None)
@example(boots=[0.0, 98.0], drift_ppm=0.0, wild=0)
@given(
    boots=st.lists(st.floats(-5e5, 5e5), min_size=2, max_size=4, unique_by=lambda b: round(b, -2)),
    drift_ppm=st.floats(-300, 300),
    wild=st.integers(0, 3),
)
def test_every_part_between_resets_is_mapped_by_its_own_exchanges(
    boots: list[float], drift_ppm: float, wild: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    # A clock that goes on, by up to a second, where it would have gone on was not reset.
    assume((np.abs(np.diff(boots) - PART_S) > 1.5).all())
    rng = np.random.default_rng(wild)
    own, host, exchanges = [], [], []
    for part, boot in enumerate(boots):
        t_s = 1000 + PART_S * part + np.arange(1500) / 50
        shown = boot + (t_s - t_s[0]) * (1 - drift_ppm * 1e-6) + 6e5
        own.append(shown)
        host.append(t_s)
        rows = np.arange(0, 1500, 100)
        by_s = t_s[rows] - shown[rows] + rng.normal(0, 2e-4, len(rows))
        by_s[rng.choice(np.arange(2, 13), wild, replace=False)] += 0.4  # a slow network
        exchanges += list(zip(shown[rows].tolist(), by_s.tolist(), strict=True))
    path = tmp_path_factory.mktemp("x") / "a.xdf"
    (verdict,) = judged(path, file_of(("gaze", np.concatenate(own), exchanges)))
    (stream,) = read_xdf_times(path)
    assert np.abs(stream.stamps_s - np.concatenate(host)).max() < 5e-3
    assert len(boots) - 1 == words(verdict).count("its clock was reset before sample")
    assert "go back" not in words(verdict)
    assert pytest.approx(50, rel=1e-3) == verdict.rate_hz


@pytest.mark.parametrize("set_by_s", [-0.9, -0.3, 0.3, 0.9])
def test_a_clock_that_was_set_by_less_than_a_second_is_told(
    tmp_path: Path, set_by_s: float
) -> None:
    host_s = 1000 + np.arange(5000) / 50
    own_s = host_s + set_by_s * (host_s >= 1050)
    rows = np.arange(0, 5000, 250)
    by_s = (host_s - own_s)[rows]
    exchanges = list(zip(own_s[rows].tolist(), by_s.tolist(), strict=True))
    (verdict,) = judged(tmp_path / "a.xdf", file_of(("gaze", own_s, exchanges)))
    assert Level.RED is verdict.level
    assert "as no clock does" in words(verdict)


@settings(max_examples=25, deadline=None)
@given(share=st.floats(0.05, 0.99))
def test_a_file_cut_anywhere_gives_the_samples_before_the_cut(
    share: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    own_s = 1000 + np.arange(1500) / 50
    content = file_of(("gaze", own_s, []), per_chunk=100)
    cut = content[: int(len(content) * share)]
    path = tmp_path_factory.mktemp("x") / "a.xdf"
    (verdict,) = judged(path, cut)
    assert 0 == verdict.samples % 100
    assert 1500 * share - 200 < verdict.samples <= 1500
    assert np.array_equal(own_s[: verdict.samples], read_xdf_times(path)[0].stamps_s)


@settings(max_examples=25, deadline=None)
@given(at=st.floats(0.2, 0.8), size=st.integers(50, 3000))
def test_zeros_in_the_middle_are_passed_over_up_to_the_next_boundary(
    at: float, size: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    own_s = 1000 + np.arange(3000) / 50
    content = bytearray(file_of(("gaze", own_s, []), per_chunk=50))
    begin = int(len(content) * at)
    content[begin : begin + size] = bytes(len(content[begin : begin + size]))
    path = tmp_path_factory.mktemp("x") / "a.xdf"
    (verdict,) = judged(path, bytes(content))
    lost = 3000 - verdict.samples
    assert lost <= size // 17 + 150
    stamps = read_xdf_times(path)[0].stamps_s
    assert 3000 - lost == len(stamps)
    if "passed over" in words(verdict):
        assert own_s[-1] == stamps[-1]


@pytest.mark.parametrize("ending", [".xdfz", ".xdf.gz"])
def test_packed_files_are_read(ending: str, tmp_path: Path) -> None:
    own_s = 1000 + np.arange(500) / 50
    content = file_of(("gaze", own_s, [(1000.0, 0.0), (1009.0, 0.0)]))
    (verdict,) = judged(tmp_path / f"a{ending}", gzip.compress(content))
    assert (Level.GREEN, 500) == (verdict.level, verdict.samples)


def test_a_reset_that_no_exchange_maps_is_red(tmp_path: Path) -> None:
    first, second = 5e5 + np.arange(1500) / 50, 100 + np.arange(1500) / 50
    exchanges = [(float(t), 1000 - 5e5) for t in first[::100]]
    content = file_of(("gaze", np.concatenate([first, second]), exchanges))
    (verdict,) = judged(tmp_path / "a.xdf", content)
    assert Level.RED is verdict.level
    assert "no exchange maps one of the parts" in words(verdict)


@pytest.mark.parametrize("wild", [1e300, -1e12, float("inf")])
def test_stamps_that_no_clock_shows_are_told(wild: float, tmp_path: Path) -> None:
    own_s = 1000 + np.arange(500) / 50
    own_s[100] = wild
    (verdict,) = judged(tmp_path / "a.xdf", file_of(("gaze", own_s, [])))
    assert Level.RED is verdict.level
    assert "1 stamps that no clock shows" in words(verdict)

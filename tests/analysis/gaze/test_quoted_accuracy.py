"""What the page on gaze quotes of detectors is quoted per preset, as the benchmarks print it."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.gaze_detectors.__main__ import OWN, main
from benchmarks.gaze_detectors.peers import PEERS
from benchmarks.gaze_detectors.rates import DETECTORS
from benchmarks.gaze_detectors.sets import SETS
from visavis.analysis.gaze import events
from visavis.study.look_measures import DEFAULT_MEASURE_PARAMETERS

PAGE = (Path(__file__).parents[3] / "docs" / "gaze.md").read_text(encoding="utf-8")
PRESETS = {
    name: value
    for name, value in vars(events).items()
    if isinstance(value, events.IvtParameters | events.IdtParameters)
}
FIGURES = 7
"""Four rates and three levels of noise."""


def test_every_preset_is_compared_with_people() -> None:
    assert {"auto", *PRESETS} == set(DETECTORS)


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_has_its_own_accuracy_on_the_page(name: str) -> None:
    rows = re.findall(rf"^\| `{name}` \|(.*)\|$", PAGE, re.MULTILINE)
    quoted = [r for r in rows if len(re.findall(r"(?<!\()(?:\.\d{3}|\b0)(?= )", r)) == FIGURES]
    assert 1 == len(quoted)


def test_the_page_says_which_preset_the_second_view_of_a_study_uses() -> None:
    used = next(n for n, value in PRESETS.items() if value == DEFAULT_MEASURE_PARAMETERS.ivt)
    item = next(i for i in PAGE.split("\n- ") if "what the second view of a study" in i)
    assert f"`{used}`" in item


def test_the_second_view_counts_fixations_by_a_preset_that_people_agree_with() -> None:
    """It was one that found two thirds of the fixations that people labelled."""
    used = next(n for n, value in PRESETS.items() if value == DEFAULT_MEASURE_PARAMETERS.ivt)
    rows = re.findall(rf"^\| `{used}` \|(.*)\|$", PAGE, re.MULTILINE)
    quoted = re.findall(r"(\.\d{3}) \(([\d.]+)\)", " ".join(rows))
    assert FIGURES == len(quoted)
    assert all(float(f1) > 0.8 and 0.85 < float(found) < 1.15 for f1, found in quoted)


def test_one_command_prints_every_detector_on_the_sets_of_a_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recording in the form of `lookatpoint`: four rests of 300 ms, labelled as they are."""
    label = np.repeat([1, 2, 1, 2, 1, 2, 1], [300, 30, 300, 30, 300, 30, 300])
    x = np.repeat([0.0, 5.0, 10.0, 15.0], [300, 300, 300, 300])
    table = np.zeros(
        len(label),
        dtype=[("t", "f8"), ("x", "f4"), ("y", "f4"), ("status", "?"), ("evt", "u1")],
    )
    table["t"], table["status"], table["evt"] = np.arange(len(label)) / 1000, True, label
    table["x"] = np.interp(
        np.arange(len(label)), np.flatnonzero(label == 1), x
    ) + np.random.default_rng(1).normal(0, 0.01, len(label))
    np.save(tmp_path / "lookAtPoint_EL_S1.npy", table)

    assert 0 == main([str(tmp_path)])

    printed = [line.split() for line in capsys.readouterr().out.splitlines()]
    rows = {" ".join(w[1:]).split("  ")[0]: w for w in printed if w and w[0] == "lookatpoint"}
    assert len(OWN) == len(rows)
    auto = next(w for w in rows.values() if w[1] == "auto")
    assert ["lookatpoint", "auto", "1", "1.000"] == auto[:4]
    assert {"pymovements I-VT", "I-VT, smoothed", "remodnav", "i2mc package"} == set(PEERS)
    assert 6 <= len(SETS)

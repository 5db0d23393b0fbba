"""`visavis warp`: what it writes, and what it refuses."""

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from visavis.cli.commands.warp import OUT_NAMES
from visavis.cli.main import app
from visavis.lab.errors import LabError
from visavis.stimuli.motion.bvh import read_bvh
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.warping.cases import CASES
from visavis.stimuli.motion.warping.control import ControlSettings

FEATURE = ("--feature", "coverage:face,right_hand:+0.25")
ASIDE = ("--observer", "1.5,1.6,-2.5")


def warp(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["warp", *map(str, arguments)])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def warped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("warp") / "out"
    warp(
        "wave",
        *ASIDE,
        *FEATURE,
        "--units",
        "spine_turn,head_turn,right_wrist_flex",
        "--seconds",
        0.2,
        "-o",
        folder,
    )
    return folder


def test_motion_sheet_curves_and_record_are_written(warped: Path) -> None:
    assert sorted(OUT_NAMES) == sorted(p.name for p in warped.iterdir())
    clip = read_clip(warped / "warped.npz")
    assert len(clip.root_m) == len(read_bvh(warped / "warped.bvh").values)
    assert np.isfinite(clip.orientation_wxyz).all()


def test_record_holds_every_parameter_and_what_was_reached(warped: Path) -> None:
    record = json.loads((warped / "warp.json").read_text(encoding="utf-8"))
    assert {f.name for f in fields(ControlSettings)} == set(record["settings"])
    assert ["coverage:face,right_hand:+0.25"] == record["features"]
    assert ["spine_turn", "head_turn", "right_wrist_flex"] == record["units"]
    assert [1.5, 1.6, -2.5] == record["observer_m"]
    assert record["original"][0] < record["reached"][0]
    assert len(record["frame_s"]) == len(record["frame_is_reached"])


def test_every_published_case_is_listed() -> None:
    said = warp("--cases")
    assert {"view_change", "past_board", "out_of_shade", "hide", "introvert"} <= set(CASES)
    assert all(name in said for name in CASES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*ASIDE, "--feature", "coverage:tail:+0.25"), "tail"),
        ((*ASIDE, *FEATURE, "--units", "tail"), "warping unit"),
        (("--observer", "0,1.1,0", *FEATURE), "move the observer back"),
        (FEATURE, "--observer"),
        (("--case", "flying"), "past_board"),
    ],
)
def test_impossible_requests_say_what_to_ask_instead(
    arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    with pytest.raises(LabError, match=message):
        warp("wave", *arguments, "--seconds", 0.1, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_with_files_is_left_alone(warped: Path) -> None:
    with pytest.raises(LabError, match="not empty"):
        warp("wave", *ASIDE, *FEATURE, "-o", warped)

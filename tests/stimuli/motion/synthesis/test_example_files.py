"""A lab's own walks: a folder of BVH files and a table become examples, or are refused by name."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip import sample_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.skeleton import canonical_skeleton, forward
from visavis.stimuli.motion.synthesis.example_blend import Blend
from visavis.stimuli.motion.synthesis.example_files import read_examples
from visavis.stimuli.motion.synthesis.walk_features import features_of
from visavis.stimuli.motion.synthesis.walk_styles import (
    reduced,
    style_a,
    style_b,
    styled_walk,
)

WALKS = {
    "plain": style_a("plain"),
    "march": style_a("march"),
    "sad": style_b("misery", "slow"),
    "glad": style_b("pleasure", "fast"),
}
LATE_S = 0.3


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of two rounds of each walk, and a table of cycles that begin in mid-air."""
    rows = []
    build = build_of_skeleton(canonical_skeleton())
    for name, style in WALKS.items():
        clip, _ = styled_walk(style, build)
        twice = sample_clip(clip, 0.0, clip.frame_s, 2 * len(clip.root_m) + 1)
        write_bvh(tmp_path / f"{name}.bvh", bvh_of_clip(twice))
        end_s = LATE_S + clip.duration_s
        rows.append({"name": name, "file": f"{name}.bvh", "begin_s": LATE_S, "end_s": end_s})
    table = pd.DataFrame(rows)
    table["activeness"] = [0.4, 0.8, 0.0, 1.0]
    table.to_csv(tmp_path / "walks.csv", index=False)
    return tmp_path


def edited(folder: Path, name: str, column: str, value: object) -> Path:
    """Change one cell of the table."""
    table = pd.read_csv(folder / "walks.csv").astype({column: object})
    table.loc[table["name"] == name, column] = value
    table.to_csv(folder / "walks.csv", index=False)
    return folder


def test_contacts_are_found_and_cycles_begin_at_the_left_foots_landing(folder: Path) -> None:
    read = read_examples(folder)
    assert read.examples.names == tuple(WALKS)
    assert read.parameters == ("activeness",)
    assert read.points.ravel().tolist() == [0.4, 0.8, 0.0, 1.0]
    for i, style in enumerate(WALKS.values()):
        clip, keys = styled_walk(style, build_of_skeleton(canonical_skeleton()))
        # Found from places at 30 a second: within two frames.
        assert np.abs(read.examples.key_s[i] - keys).max() < 2.1 / 30
        own, got = features_of(reduced(clip)), features_of(read.examples.clip(i))
        assert got["step_length_fb"] == pytest.approx(own["step_length_fb"], abs=0.005)
        assert got["mean_torso_fb"] == pytest.approx(own["mean_torso_fb"], abs=3.0)
        assert got["sd_left_thigh_fb"] == pytest.approx(own["sd_left_thigh_fb"], abs=1.0)


def test_given_contacts_are_taken(folder: Path) -> None:
    table = pd.read_csv(folder / "walks.csv")
    for i, style in enumerate(WALKS.values()):
        _, keys = styled_walk(style, build_of_skeleton(canonical_skeleton()))
        for name, at_s in zip(
            ("left_down_s", "right_up_s", "right_down_s", "left_up_s"), keys[:4], strict=True
        ):
            own = at_s if at_s >= LATE_S else at_s + keys[-1]
            table.loc[i, name] = own
    table.to_csv(folder / "walks.csv", index=False)
    read = read_examples(folder)
    for i, style in enumerate(WALKS.values()):
        _, keys = styled_walk(style, build_of_skeleton(canonical_skeleton()))
        assert read.examples.key_s[i] == pytest.approx(keys, abs=1e-6)


def test_own_walks_blend_without_a_jump(folder: Path) -> None:
    blend = Blend(read_examples(folder).examples, np.array([0.1, 0.2, 0.3, 0.4]))
    times = np.arange(0.0, 2 * blend.cycle_s, 1 / 240)
    frames = blend.at(times)
    places = forward(blend.skeleton, frames.root_m, frames.orientation_wxyz).position_m
    assert np.linalg.norm(np.diff(places, axis=0), axis=-1).max() * 240 < 6.0


@pytest.mark.parametrize(
    ("name", "column", "value", "words"),
    [
        ("sad", "file", "gone.bvh", "row 4: there is no file"),
        ("sad", "end_s", 99.0, "row 4: from 0.3 s to 99 s"),
        ("sad", "end_s", "soon", "row 4: end_s is 'soon'"),
        ("glad", "activeness", 1.5, "row 5: activeness is '1.5'"),
        ("plain", "begin_s", None, "row 2: begin_s is 'nan'"),
        ("sad", "end_s", 0.5, "'sad' has no contacts"),
        ("sad", "name", "glad", "two examples are called 'glad'"),
    ],
)
def test_a_table_that_is_wrong_is_refused_by_its_row(
    folder: Path, name: str, column: str, value: object, words: str
) -> None:
    with pytest.raises(MotionError, match=words):
        read_examples(edited(folder, name, column, value))


def test_a_folder_that_is_no_set_of_walks_is_refused(folder: Path, tmp_path: Path) -> None:
    text = (folder / "sad.bvh").read_text("utf-8")
    (folder / "sad.bvh").write_text(text.replace("left_hand", "left_paw"), "utf-8")
    with pytest.raises(MotionError, match="skeleton of walk 'sad' is not that of 'plain'"):
        read_examples(folder)
    lines = text.splitlines()
    lines[-3] = lines[-3].replace(lines[-3].split()[4], "nan", 1)
    (folder / "sad.bvh").write_text("\n".join(lines), "utf-8")
    with pytest.raises(MotionError, match="not a number"):
        read_examples(folder)
    table = pd.read_csv(folder / "walks.csv")
    table.iloc[:2].to_csv(folder / "walks.csv", index=False)
    with pytest.raises(MotionError, match="at least 3"):
        read_examples(folder)
    (folder / "more.csv").write_text("name,file\n", "utf-8")
    with pytest.raises(MotionError, match="2 tables"):
        read_examples(folder)
    with pytest.raises(MotionError, match="0 tables"):
        read_examples(folder / "nowhere")

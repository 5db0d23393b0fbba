"""visavis gesture and visavis corpus: a script becomes a motion, and a speaker is summed up."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from visavis.cli.main import app
from visavis.cli.speaker_sheet import speaker_text
from visavis.lab.errors import UsageError
from visavis.stimuli.characters.gltf.file import read_glb
from visavis.stimuli.motion.bvh import read_bvh, write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.speaking.gesture_script import format_script
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_speaker, synthetic_take


def visavis(*arguments: object) -> Result:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def taken(folder: Path, seed: int) -> Path:
    """Write one take of a speaker beside its annotation."""
    folder.mkdir()
    clip, script, _ = synthetic_take(seed, 0.5)
    write_bvh(folder / "one.bvh", bvh_of_clip(clip), decimals=5)
    (folder / "one.yaml").write_text(format_script(script), encoding="utf-8")
    return folder


@pytest.fixture
def takes(tmp_path: Path) -> Path:
    return taken(tmp_path / "speaker", seed=5)


SCRIPT = """duration_s: 2.5
phrases:
- {start_s: 0.3, stroke_s: 0.8, stroke_end_s: 1.2, end_s: 2.0, hand: R, lexeme: cup}
"""


def performed(takes: Path, folder: Path, *names: str) -> list[Path]:
    """Perform the script into files."""
    script = folder / "speech.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    for name in names:
        visavis("gesture", script, "--corpus", takes, "--fill", "I", "-o", folder / name)
    return [folder / name for name in names]


def test_a_script_becomes_a_bvh_file_of_its_length_the_same_every_time(
    takes: Path, tmp_path: Path
) -> None:
    one, two = performed(takes, tmp_path, "one.bvh", "two.bvh")
    assert one.read_bytes() == two.read_bytes()
    assert len(read_bvh(one).values) == 76


def test_a_script_becomes_a_figure_that_moves_as_the_motion_says(
    takes: Path, tmp_path: Path
) -> None:
    motion_path, figure_path = performed(takes, tmp_path, "speech.npz", "speech.glb")
    clip, content = read_clip(motion_path), read_glb(figure_path)
    (motion,) = content.items("animations")
    assert "speech" == motion["name"]
    hand = clip.skeleton.index("right_hand")
    (turns,) = (
        motion["samplers"][channel["sampler"]]
        for channel in motion["channels"]
        if channel["target"] == {"node": hand + 1, "path": "rotation"}
    )
    assert [2.5] == content.items("accessors")[turns["input"]]["max"]
    xyzw = content.accessor(turns["output"])
    np.testing.assert_allclose(xyzw, clip.orientation_wxyz[:, hand][:, [1, 2, 3, 0]], atol=1e-5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--fill", "G"), "--fill 'G'; give F, I or none"),
        (("-o", "speech.fbx"), "name it .bvh, .npz, .glb for a motion"),
        (("--beta", "1.5"), "--beta 1.5; give a share"),
        (("--corpus", "a", "--corpus", "b", "--corpus", "c"), "--corpus c: give one speaker, or"),
        (("--rate", "0"), "--rate 0; give 1 to 240"),
        (("--tier", "word=Wort"), "--tier 'word=Wort'; give one of phrase, phase, hand, lexeme"),
    ],
)
def test_impossible_options_are_refused_before_anything_is_made(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    script = tmp_path / "speech.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    if "-o" not in arguments:
        arguments = (*arguments, "-o", str(tmp_path / "out.bvh"))
    with pytest.raises(UsageError, match=message):
        visavis("gesture", script, *arguments)


def test_the_second_corpus_gives_the_habits(takes: Path, tmp_path: Path) -> None:
    script, other = tmp_path / "speech.yaml", taken(tmp_path / "other", seed=6)
    script.write_text(SCRIPT, encoding="utf-8")
    motions = []
    for folders in ((takes,), (takes, takes), (takes, other)):
        corpora = [part for folder in folders for part in ("--corpus", folder)]
        path = tmp_path / f"{len(motions)}.bvh"
        visavis("gesture", script, *corpora, "--seed", "3", "-o", path)
        motions.append(path.read_bytes())
    assert motions[0] == motions[1] != motions[2]


def test_a_corpus_is_summed_up_as_numbers(takes: Path) -> None:
    about = json.loads(visavis("corpus", "fit", takes, "--json").output)
    assert about["takes"] == ["one.bvh"]
    for part in ("com", "yaw"):
        for row in about["transitions"][part].values():
            assert sum(cell["share"] for cell in row["to"].values()) == pytest.approx(1.0)


def test_the_summary_names_every_planted_rule_with_its_count() -> None:
    text = "\n".join(speaker_text(synthetic_speaker(3, 4.0)[0]))
    for rule in (
        "RH               -> right",
        "LH               -> left",
        "wipe             -> left",
    ):
        assert rule in text
    assert "weight comes to rest 0." in text
    assert "before the stroke's end" in text


def test_motions_are_measured_beside_a_corpus(takes: Path, tmp_path: Path) -> None:
    script = tmp_path / "speech.yaml"
    script.write_text(SCRIPT, encoding="utf-8")
    for fill in ("none", "I"):
        path = tmp_path / f"{fill}.npz"
        visavis("gesture", script, "--corpus", takes, "--fill", fill, "-o", path)
    motions = (tmp_path / "none.npz", tmp_path / "I.npz", takes / "one.bvh")
    printed = visavis("corpus", "measure", *motions, "--corpus", takes, "--json").output
    still, holds, take = json.loads(printed)
    assert (1.0, 0.0) == (still["still_01"], still["posture_bits"])
    assert 1.0 > holds["still_01"] > take["still_01"]
    assert [0.0, 0.0] == pytest.approx([still["sliding_cmps"], holds["sliding_cmps"]], abs=1e-6)
    assert still["jerk_mps3"] < holds["jerk_mps3"]
    assert take["posture_bits"] == pytest.approx(take["corpus_bits"])
    assert take["apart_bits"] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < still["apart_bits"] <= 1.0
    table = visavis("corpus", "measure", *motions, "--corpus", takes).output
    assert "none.npz" in table

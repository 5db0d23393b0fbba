"""`visavis blend`: adjectives, features and weights make a walk; what is wrong is named."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import Result
from typer.testing import CliRunner

from visavis.cli.main import app
from visavis.lab.errors import LabError, UsageError
from visavis.running.page.playground import Play
from visavis.stimuli.characters.gltf.file import read_glb
from visavis.stimuli.motion.bvh import read_bvh
from visavis.stimuli.motion.clip_file import read_clip
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.walk_styles import walk_set


def run(*arguments: str) -> Result:
    result = CliRunner().invoke(app, ["blend", *arguments])
    if isinstance(result.exception, LabError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


def blended(*arguments: str) -> str:
    return run(*arguments).output


def of(*arguments: str) -> dict[str, dict[str, float]]:
    values: dict[str, dict[str, float]] = json.loads(run(*arguments, "--json").stdout)
    return values


def test_more_activeness_swings_the_arms_more_and_more_quickness_is_faster() -> None:
    still, active, quick = (
        of("--adjectives", text) for text in ("activeness=.1", "activeness=.9", "quickness=.9")
    )
    swing = "sd_left_upper_arm_fb"
    assert active["features"][swing] > still["features"][swing] + 5
    assert quick["cycle_s"] < min(active["cycle_s"], still["cycle_s"])
    assert sum(active["weights"].values()) == pytest.approx(1.0)


def test_features_are_followed_in_groups_and_alone() -> None:
    low, high = (of("--features", f"duration={v}") for v in (0.1, 0.9))
    assert high["features"]["duration"] > low["features"]["duration"] + 0.1
    bent = of("--features", "upper_bend=.9")["features"]["mean_torso_fb"]
    assert bent > of("--features", "upper_bend=.1")["features"]["mean_torso_fb"] + 5


def test_a_walk_is_written_as_bvh_and_as_clip(tmp_path: Path) -> None:
    path = tmp_path / "walk.bvh"
    blended("--examples", "set_a", "--weights", "march=1", "--rounds", "2", "-o", str(path))
    bvh = read_bvh(path)
    assert len(bvh.joints) == 20
    assert len(bvh.values) == 2 * 32 + 1
    blended("--examples", "set_a", "--weights", "march=1", "-o", str(tmp_path / "walk.npz"))
    clip = read_clip(tmp_path / "walk.npz")
    assert np.abs(np.diff(clip.root_m[:, 2])).mean() * 30 == pytest.approx(1.2, abs=0.01)
    with pytest.raises(UsageError, match="exists already"):
        blended("--weights", "misery_slow=1", "-o", str(path))


def test_a_walk_is_written_as_gltf_on_the_body_of_somebody(tmp_path: Path) -> None:
    path = tmp_path / "walk.glb"
    arguments = ("--weights", "march=1", "--rounds", "2", "--character", "anna", "-o", str(path))
    blended("--examples", "set_a", *arguments)
    assert path.stat().st_size < 4_000_000
    content = read_glb(path)
    (motion,) = content.items("animations")
    assert motion["name"] == "walk"
    last_s = max(content.items("accessors")[s["input"]]["max"][0] for s in motion["samplers"])
    cycle_s = of("--examples", "set_a", "--weights", "march=1")["cycle_s"]
    assert last_s == pytest.approx(2 * float(str(cycle_s)), abs=1e-3)


def test_a_page_to_play_with_has_a_slider_for_every_parameter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shown: list[Play] = []
    monkeypatch.setattr("visavis.cli.blend_page.show_page", shown.append)
    for arguments in (
        (),
        ("--adjectives", "activeness=.8"),
        ("--features", "duration=.2"),
        ("--examples", "set_a", "--weights", "march=1"),
    ):
        blended("--page", "--character", "anna", *arguments)
    sliders = [{s.name: s.start for s in play.sliders} for play in shown]
    assert list(sliders[0]) == ["quickness", "clearness", "activeness", "largeness"]
    assert sliders[1]["activeness"] == 0.8
    assert sliders[2]["duration"] == 0.2
    assert len(sliders[2]) == 5
    assert {name for name, start in sliders[3].items() if start > 0} == {"march"}
    assert [len(play.live.examples) for play in shown] == [27, 27, 27, 10]
    assert [play.option for play in shown][1:] == ["--adjectives", "--features", "--weights"]
    with pytest.raises(UsageError, match="--page shows the walk"):
        blended("--page", "-o", "x.glb")


def test_what_can_be_given_is_listed_and_whose_ratings_it_rests_on() -> None:
    listed = blended()
    assert "quickness, clearness, activeness, largeness" in listed
    assert "people have not rated these walks" in listed
    assert "step_length" in listed


def test_few_examples_for_many_parameters_are_warned_of() -> None:
    singles = ",".join(f"{name}=.5" for name in ("duration", "mean_com_up", "sd_torso_lr"))
    assert "unsteady" in blended("--examples", "set_a", "--features", singles)
    assert "unsteady" not in blended("--features", singles)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--adjectives", "happiness=.5"), "there is no 'happiness'"),
        (("--adjectives", "quickness=1.2"), "from 0 to 1"),
        (("--adjectives", "quickness=.2,quickness=.3"), "every name once"),
        (("--features", "duration=soon"), "from 0 to 1"),
        (("--weights", "march=1"), "there is no 'march'"),
        (("--weights", "misery_slow=-1"), "a number from 0"),
        (("--weights", "misery_slow=1", "--features", "duration=.5"), "not several"),
        (("--examples", "set_c"), "neither set_a, set_b, waves, beats nor a folder"),
        (("--weights", "misery_slow=1", "-o", "walk.fbx"), "ends in .bvh"),
        (("--rounds", "0"), "1 to 100"),
    ],
)
def test_what_cannot_be_given_is_named(arguments: tuple[str, ...], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        blended(*arguments)


def test_ratings_of_a_study_take_the_place_of_those_simulated(tmp_path: Path) -> None:
    names = walk_set("set_b").names
    path = tmp_path / "impressions.csv"
    fast = [0.9 if name.endswith("fast") else 0.1 for name in names]
    own = np.random.default_rng(1).uniform(size=(len(names), 2))
    table = pd.DataFrame({"name": names, "quickness": fast, "clearness": own[:, 0]})
    table["sad_happy"] = own[:, 1]
    table.iloc[::-1].to_csv(path, index=False)
    listed = blended("--ratings", str(path))
    assert "quickness, clearness, sad_happy" in listed
    assert "people have not rated" not in listed
    quick, slow = (
        of("--ratings", str(path), "--adjectives", f"quickness={v},sad_happy=.5") for v in (1, 0)
    )
    assert quick["cycle_s"] < slow["cycle_s"]
    table.assign(clearness=2.0).to_csv(path, index=False)
    with pytest.raises(UsageError, match="clearness is not from 0 to 1"):
        blended("--ratings", str(path))
    table.iloc[1:].to_csv(path, index=False)
    with pytest.raises(UsageError, match="has not just the examples"):
        blended("--ratings", str(path))
    with pytest.raises(UsageError, match="cannot be read"):
        blended("--ratings", str(tmp_path / "gone.csv"))


def test_gestures_are_blended_as_walks_are(tmp_path: Path) -> None:
    listed = blended("--examples", "waves")
    assert "5 examples: plain, large, shy, hasty, weary" in listed
    assert "adjectives: none" in listed
    assert "people have not rated" not in listed
    path = tmp_path / "wave.glb"
    blended("--examples", "waves", "--weights", "large=1,hasty=1", "-o", str(path))
    (motion,) = read_glb(path).items("animations")
    assert motion["name"] == "wave"
    made = of("--examples", "beats", "--features", "duration=.8")
    assert sum(made["weights"].values()) == pytest.approx(1.0)
    with pytest.raises(UsageError, match="these examples have none"):
        blended("--examples", "beats", "--adjectives", "quickness=.5")


def test_a_map_shows_what_no_blend_comes_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("visavis.cli.commands.blend.REACH_BLENDS", 60)
    path = tmp_path / "reach.png"
    found = json.loads(run("--examples", "set_a", "--reach", str(path), "--json").stdout)
    assert found["blends"] == 70  # and the examples themselves
    assert len(found["reached"]) == 6
    assert all(0 < share < 1 for share in found["reached"].values())
    assert path.stat().st_size > 10_000
    with pytest.raises(UsageError, match=r"ends in \.png"):
        blended("--reach", "map.txt")


def test_weights_that_are_all_zero_are_refused() -> None:
    with pytest.raises(MotionError, match="all weights are zero"):
        blended("--weights", "misery_slow=0")

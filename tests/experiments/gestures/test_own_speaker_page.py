"""What docs/gestures.md tells a lab that has its own speaker works, block by block."""

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pandas as pd
import pytest

from tests.study.test_write_a_study_page import commands_of, typed_in, write
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.clip_file import write_clip
from visavis.stimuli.motion.speaking.gesture_script import format_script
from visavis.stimuli.motion.speaking.synthetic_speaker import synthetic_take

PAGE = Path(__file__).parents[3] / "docs" / "gestures.md"
BLOCK = re.compile(r"^ *```(\w+)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


def test_a_lab_puts_its_own_speaker_into_both_studies_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    recorded(tmp_path / "recordings" / "speaker_1")
    section = PAGE.read_text("utf-8").split("## A lab's own speaker\n")[1].split("\n## ")[0]
    kinds = []
    for kind, indented in BLOCK.findall(section):
        kinds.append(kind)
        text = textwrap.dedent(indented)
        if kind == "sh":
            subprocess.run(text, shell=True, check=True, timeout=300)  # noqa: S602  # our own page
        elif kind == "python":
            write(tmp_path, text)
        for command, expected in commands_of(text) if kind == "console" else ():
            said = typed_in(command)
            for line in expected:
                pattern = ".*".join(map(re.escape, line.strip().split("…")))
                assert re.search(pattern, said), f"{command}\n{line}\nis not in\n{said}"
    assert ["console", "sh", "python", "console", "python", "console"] == kinds
    asked = pd.read_csv(tmp_path / "out/simulated/likeness/derived/trials.csv")
    assert {"speaker_1"} == set(asked["speaker"])
    assert asked["likeness"].between(0, 100).sum() == asked["match"].between(-2, 2).sum() > 0
    for study in ("own_gestures", "own_pairs"):
        folder = tmp_path / "out" / "simulated" / study / "derived"
        assert "As the source analysed it" in (folder / "report.html").read_text("utf-8")
    takes = "import clips; print(*[take.name for take in clips.SPEAKERS['speaker_1']().takes])"
    printed = subprocess.run(
        [sys.executable, "-c", takes],
        cwd=tmp_path / "gestures",
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    assert "take_1.bvh take_2.npz" == printed.stdout.strip()


def recorded(folder: Path) -> None:
    """Write two takes of a speaker, one as BVH and one as a clip of ours."""
    folder.mkdir(parents=True)
    for name, seed in (("take_1", 5), ("take_2", 6)):
        clip, script, _ = synthetic_take(seed, 1.5)
        (folder / f"{name}.yaml").write_text(format_script(script), encoding="utf-8")
        if name == "take_1":
            write_bvh(folder / f"{name}.bvh", bvh_of_clip(clip), decimals=5)
        else:
            write_clip(folder / f"{name}.npz", clip)

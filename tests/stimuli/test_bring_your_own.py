"""The examples of docs/bring-your-own.md run as they stand."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.stimuli.glb_figure import write_glb
from visavis.stage.errors import StageError
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.build import build_of_skeleton
from visavis.stimuli.motion.bvh import write_bvh
from visavis.stimuli.motion.bvh_clip import bvh_of_clip
from visavis.stimuli.motion.kinds import Wave
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.skeleton import canonical_skeleton

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bring-your-own.md"


def test_examples_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_glb(tmp_path / "visitor_F.glb")
    waver = Person(build_of_skeleton(canonical_skeleton(1.7)), Wave("right"), 1)
    write_bvh(tmp_path / "greeting.bvh", bvh_of_clip(bake(waver, 3.0)))
    examples = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(examples) == 6
    names: dict[str, object] = {"__name__": "example"}
    for example in examples[:-1]:
        exec(compile(example, str(PAGE), "exec"), names)  # noqa: S102 - the page's own examples
    room = names["waiting_room"]
    assert getattr(room, "name", None) == "waiting room"
    try:
        exec(compile(examples[-1], str(PAGE), "exec"), names)  # noqa: S102 - as above
    except StageError as problem:
        pytest.skip(str(problem))
    image = np.asarray(names["image"])
    assert image.shape == (240, 320, 3)
    assert image.std() > 20

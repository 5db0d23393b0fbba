"""How often a frame at full quality calls the driver: what a card needs for 90 frames a second."""

import json
import os

import pytest

from tests.commands import COMMANDS, ROOT
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer

MAX_UPLOADS = 5
"""Joints, lamps, a camera for each eye, and the table of who stands at which level."""
Counts = dict[str, list[dict[str, int]]]


@pytest.fixture(scope="module")
def counts() -> Counts:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))
    softly = {**os.environ, "GALLIUM_NOOP": "1", "LIBGL_ALWAYS_SOFTWARE": "1"}
    process = COMMANDS.run("-m", "tests.stage.gl_counts", cwd=ROOT, env=softly)
    assert 0 == process.returncode, process.stderr
    counts: Counts = json.loads(process.stdout)
    return counts


@pytest.mark.parametrize(("scene", "most"), [("stare", 33), ("crowd", 40)])
def test_a_frame_for_both_eyes_takes_a_few_calls(counts: Counts, scene: str, most: int) -> None:
    _, second, third, _ = counts[scene]
    assert second == third
    assert 5 < second["draws"] <= most
    assert second["binds"] <= most
    assert second["uploads"] < MAX_UPLOADS
    assert "made" not in second


def test_whoever_changes_level_is_one_table_more_to_send(counts: Counts) -> None:
    _, _, before, after = counts["crowd"]
    assert before["uploads"] + 1 == after["uploads"] == MAX_UPLOADS
    assert before["draws"] == after["draws"]
    assert "made" not in after


def test_another_cast_of_the_same_people_sends_no_models_or_pictures_again(counts: Counts) -> None:
    first, again = counts["stare"][0], counts["stare, one fewer"][0]
    assert again["uploads"] == MAX_UPLOADS < first["uploads"]

"""The CPU raster of warping against the identity images of the stage, pixel by pixel."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from visavis.stage.errors import StageError
from visavis.stage.identity import IdentityBuffer
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.motion.warping.cases import case_named, stage_case
from visavis.stimuli.motion.warping.perceived import perceived_parts, seen_body
from visavis.stimuli.picture import Picture, PosedPeople, Room
from visavis.stimuli.rooms.furniture import place_prop

LEVEL = 0


@pytest.fixture(scope="module")
def buffer() -> Iterator[IdentityBuffer]:
    try:
        made = IdentityBuffer()
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


@pytest.mark.parametrize("name", ["view_change", "past_board", "past_slats", "far"])
def test_raster_agrees_with_the_stage_but_for_edge_pixels(buffer: IdentityBuffer, name: str):
    who = load_character("anna")
    stage = stage_case(case_named(name), who, size_px=160)
    body = seen_body(who.measuring[LEVEL], who.skeleton, who.materials)
    things = tuple(
        place_prop(f"thing_{i}", mesh, (0, 0, 0), 0.0) for i, mesh in enumerate(stage.case.things())
    )
    room = Room("bare", things, (), np.full(3, 0.5), np.full(3, 0.5))
    for t_s in (0.1, 0.9):
        pose = stage.clip.at(t_s)
        people = PosedPeople(
            pose.root_m[None], pose.orientation_wxyz[None], np.zeros((1, len(MORPHS)))
        )
        picture = Picture(0, room, (who,), people)
        drawn = buffer.views(picture, [stage.view.camera], (160, 160), level=LEVEL).part[0]
        ours = perceived_parts(body, stage.view, pose.root_m[None], pose.orientation_wxyz[None])[0]
        differs = ours != drawn
        edge = np.zeros_like(differs)
        for image in (ours, drawn.astype(np.uint8)):
            edge |= maximum_filter(image, 3) != minimum_filter(image, 3)
        assert (ours > 0).sum() > (40 if name == "far" else 400)
        assert not differs[~edge].any()
        assert differs.sum() <= 0.01 * edge.sum()

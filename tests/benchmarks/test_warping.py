"""The floor of renders in control steps fills what moves, and nothing else."""

from dataclasses import replace

import numpy as np

from benchmarks.warping import fill_all, sampled_body, situation_of
from visavis.stimuli.characters.cast import load_character
from visavis.stimuli.motion.warping.cases import case_named, stage_case
from visavis.stimuli.motion.warping.control import probes_of, warped_turns
from visavis.stimuli.motion.warping.perceived import (
    body_of,
    matrices_of,
    perceived_parts,
    poses_alike,
)
from visavis.stimuli.motion.warping.raster_kernels import BOTH_SIDES


def test_the_floor_goes_through_all_that_moves_and_fills_every_pixel_that_changes():
    stage = stage_case(case_named("view_change"), load_character("anna"))
    body = sampled_body(body_of(stage.character), 1000)
    moment = situation_of(stage, replace(body, labels=body.labels & (BOTH_SIDES - 1)))
    still = np.zeros((1, len(moment.units)))
    probes = np.concatenate([still, probes_of(moment, 4.0)])
    turns = warped_turns(moment.body.skeleton, moment.units, moment.local_wxyz, probes)
    roots = np.repeat(moment.root_m[None], len(probes), axis=0)
    matrices = matrices_of(moment.body.skeleton, roots, turns)
    expected = sum(
        len(moving.faces.labels) * len(rows) for moving, rows in poses_alike(moment.body, matrices)
    )
    ids, n_filled = fill_all(moment, probes)
    assert expected == n_filled > 0
    parts = perceived_parts(moment.body, moment.view, roots, turns)
    is_new = (parts[0] == 0) & (parts != 0)
    assert is_new.any()
    assert (ids[is_new] == 1).all()

"""Everything a page needs to blend examples, as bytes: `site/blend.js` reads them."""

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.style_weights import StyleWeights
from visavis.stimuli.page_arrays import packed_arrays


def packed_examples(examples: Examples, weights: StyleWeights | None = None) -> bytes:
    """Return examples, and what leads from sliders to weights; without it, sliders are weights.

    Raises:
        MotionError: the weights are of another number of examples.
    """
    if weights is not None and len(weights.examples) != len(examples):
        raise MotionError(
            f"weights of {len(weights.examples)} examples do not fit {len(examples)}; fit them anew"
        )
    parents, offsets_m, feet, heel_m, flat_phases = examples.tree
    arrays: dict[str, Vector] = {
        "parents": parents.astype(np.float64),
        "offsets_m": offsets_m,
        "feet": feet.astype(np.float64),
        "heel_m": heel_m,
        "flat_phases": flat_phases,
        "first": examples.first.astype(np.float64),
        "key_s": examples.key_s,
        "travel_m": examples.travel_m,
        "turns": examples.turns,
        "root_m": examples.root_m,
        "foot_m": examples.foot_m,
        "foot_turns": examples.foot_turns,
    }
    if weights is not None:
        arrays |= {
            "points": weights.examples,
            "linear": weights.linear,
            "radial": weights.radial,
            "reach": weights.reach,
        }
    head = {
        "names": examples.names,
        "joints": len(examples.skeleton.names),
        "joint_names": examples.skeleton.names,
        "frame_s": examples.frame_s,
    }
    return packed_arrays(head, {name: np.asarray(a, "<f8") for name, a in arrays.items()})

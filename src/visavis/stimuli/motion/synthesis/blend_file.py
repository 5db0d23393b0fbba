"""Everything a page needs to blend examples, as bytes: `site/blend.js` reads them.

A file is the length of its head (4 bytes, little-endian), the head as JSON, and arrays of doubles
from the next multiple of eight bytes on, in the order of `arrays` in the head.
"""

import json
import struct

import numpy as np

from visavis.lab.geometry import Vector
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.synthesis.examples import Examples
from visavis.stimuli.motion.synthesis.style_weights import StyleWeights


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
        "arrays": [[name, array.shape] for name, array in arrays.items()],
    }
    text = json.dumps(head).encode()
    start = struct.pack("<I", len(text)) + text
    start += b" " * (-len(start) % 8)
    return start + b"".join(np.ascontiguousarray(a, "<f8").tobytes() for a in arrays.values())

"""What was shown at moments of a trial, and a scene of it as a page holds it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from visavis.cli.viewer.bundle import Bundle
from visavis.cli.viewer.flat import Showing
from visavis.cli.viewer.models import Models
from visavis.cli.viewer.motion import key_samples
from visavis.cli.viewer.moving import NOTHING_MOVES, MovingFiles
from visavis.lab.clock import NS_PER_S
from visavis.lab.geometry import Vector
from visavis.stimuli.motion.rotations import one_way_round
from visavis.stimuli.picture import Picture
from visavis.stimuli.scene import Agent

SAMPLES_PER_S: Final = 20
"""How often a trial's scene is looked at; poses between keys are interpolated."""
OFF_BY_M: Final = 0.002
OFF_BY_TURN: Final = 0.004
"""How far a pose between two keys may be off: hips in metres, joints in parts of a quaternion."""
OFF_BY_SHARE: Final = 0.02


@dataclass(frozen=True)
class Times:
    """Session times of all parts on one line of seconds."""

    offset_s: Mapping[int, float]

    def s(self, part: int, t_ns: int) -> float:
        """Return the second on the page of a part's session time."""
        return round(self.offset_s[part] + t_ns / NS_PER_S, 6)


@dataclass(frozen=True, eq=False)
class Sample:
    """What was shown at a moment of a trial."""

    t_ns: int
    picture: Picture
    agents: tuple[Agent, ...]
    full_picture: Picture
    """The same with the participant in it, last, where somebody can stand in for them."""
    showing: Showing | None = None
    """The flat stimuli in it."""
    moving: MovingFiles = NOTHING_MOVES
    """What of them moves, whose pixels `picture` has not."""


def scene_content(
    trial_id: str,
    part: int,
    samples: Sequence[Sample],
    end_ns: int,
    models: Models,
    bundle: Bundle,
    times: Times,
) -> dict[str, Any]:
    """Return what a page says of samples that show the same people and things in one place, up to
    a time of a part of the session.
    """
    first = samples[0].picture
    n = len(samples)
    # Samples come first in these arrays (samples, people, ...); tracks of keys want people first.
    root = np.array([s.full_picture.people.root_m for s in samples])
    turns = one_way_round(np.array([s.full_picture.people.orientation_wxyz for s in samples]))
    morphs = np.array([s.full_picture.people.morphs_01 for s in samples])
    people = root.shape[1]
    joints = turns.shape[2] if people else 0
    return {
        "trial": trial_id,
        "t0": times.s(part, samples[0].t_ns),
        "t1": times.s(part, end_ns),
        "rate": SAMPLES_PER_S,
        "n": n,
        "room": models.room(samples[0].full_picture.room),
        "cast": [models.person(c) for c in samples[0].full_picture.cast],
        "participant": len(first.cast)
        if len(samples[0].full_picture.cast) > len(first.cast)
        else -1,
        "joints": joints,
        "root": _keys(bundle, root.transpose(1, 0, 2), OFF_BY_M, 1e-3 / 4),
        "turns": _keys(
            bundle,
            turns.transpose(1, 2, 0, 3).reshape(people * joints, n, 4),
            OFF_BY_TURN,
            1 / 32767,
            turns=True,
        ),
        "morphs": _keys(bundle, morphs.transpose(1, 0, 2), OFF_BY_SHARE, 1 / 1000),
        "light": bundle.add_quantised(np.array([[s.picture.brightness_01] for s in samples])),
        "mark": None if first.mark_m is None else [float(x) for x in first.mark_m],
        # Of the first sample: all of them show the same things, boards and agents.
        "moving": [
            {
                "mesh": models.thing(m.prop),
                "at": m.pose.position_m.tolist(),
                "turn": m.pose.orientation_wxyz.tolist(),
                "glow": m.prop.emission_01,
            }
            for m in first.moving
        ],
        "panels": [
            {
                "text": p.text,
                "choices": list(p.choices),
                "at": p.pose.position_m.tolist(),
                "turn": p.pose.orientation_wxyz.tolist(),
                "size": list(p.size_m),
                "lit": p.highlighted,
            }
            for p in first.panels
        ],
        "agents": [
            {
                "id": a.agent_id,
                "place": a.place,
                "at": a.head_centre_m.tolist(),
                "radius": a.head_radius_m,
            }
            for a in samples[0].agents
        ],
    }


def _keys(
    bundle: Bundle, tracks: Vector, off_by: float, step: float, *, turns: bool = False
) -> dict[str, Any]:
    """Take in tracks (t, n, k) as keys in parts of `step`."""
    if not len(tracks):
        return {"step": step, "k": 0}
    counts, samples = key_samples(tracks, off_by, turns=turns)
    owner = np.repeat(np.arange(len(tracks)), counts)
    values = np.rint(tracks[owner, samples] / step)
    return {
        "step": step,
        "k": tracks.shape[2],
        "counts": bundle.add(counts.astype(np.uint16 if counts.max() < 65536 else np.uint32)),
        "at": bundle.add(samples.astype(np.uint16 if samples.max() < 65536 else np.uint32)),
        "v": bundle.add(values.astype(np.int16 if np.abs(values).max() < 32768 else np.int32)),
    }

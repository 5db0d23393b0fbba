"""Rendered view of a wave from the line of customers: pixels of eyes, head, torso and hand.

The raster of visual motion warping draws the clerk at the resolution of a headset, past
furniture and people, from the observer's eyes. Bearings are horizontal angles at the clerk,
positive to the observers' right.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from visavis.lab.geometry import Vector, rotate
from visavis.stimuli.characters.body_parts import PARTS
from visavis.stimuli.dressing.office import pose_of_waver
from visavis.stimuli.dressing.office_view import (
    MIDDLE_ABOVE_HIPS_M,
    VIEW_RADIUS_M,
    eye_at,
    seen_body_of,
    view_of,
)
from visavis.stimuli.motion.clip import Frames
from visavis.stimuli.motion.skeleton import forward
from visavis.stimuli.motion.warping.outlook import Outlook
from visavis.stimuli.motion.warping.perceived import mask_of, seen_and_free_parts
from visavis.stimuli.motion.warping.track import WarpTrack
from visavis.stimuli.scenes import office as places
from visavis.stimuli.scenes.office import Waving

PIXELS_PER_DEG: Final = 12.0
"""Resolution of a headset of the source's time (1080 pixels over about 90°)."""
LOOKS: Final = 6
"""Moments of a wave that are looked at."""
REACH_PX: Final = 96
CUE_PARTS: Final = (("eyes",), ("face", "eyes"), ("torso", "neck"), ("right_hand", "right_forearm"))
REACH_PARTS: Final = ("face", "eyes", "right_hand")


@dataclass(frozen=True, eq=False)
class Evidence:
    """Everything an observer can see of one wave.

    `pixels` (4,) visible of eyes, head, torso and hand, mean over the looks; `free` (4,) the same
    with nothing in between; `pointing_deg` (4,) the bearing each points to; `bearing_deg` (5,) of
    the customers' places; `reach_01` (5,) the share of head and hand that somebody in each place
    sees.
    """

    pixels: Vector
    free: Vector
    pointing_deg: Vector
    bearing_deg: Vector
    reach_01: Vector

    @property
    def visible_01(self) -> float:
        """Share of head, torso and hand that nothing hides."""
        return float(self.pixels[1:].sum() / max(self.free[1:].sum(), 1.0))


def evidence_of(
    waving: Waving, viewer_place: str, eye_m: Vector, gaze: Vector, warp: WarpTrack | None = None
) -> Evidence:
    """Render a wave, as it was drawn, from an observer's eyes (3,) and from every customer's place.

    Office coordinates; `gaze` (3,) is where the clerk's eyes point; `warp` stands in place of the
    wave's own.
    """
    view = _sharp_view(waving.clerk, eye_m, viewer_place)
    poses = _poses(waving, warp)
    pixels, free = _pixels(waving.clerk, poses, view)
    heads, pointing = _pointing(waving, poses, gaze)
    return Evidence(
        pixels=pixels,
        free=free,
        pointing_deg=pointing,
        bearing_deg=np.array([_bearing_deg(eye_at(c.name) - heads) for c in places.CUSTOMERS]),
        reach_01=reach_of(waving, warp),
    )


@lru_cache(maxsize=256)
def reach_of(waving: Waving, warp: WarpTrack | None = None) -> Vector:
    """Return the share (5,) of head and waving hand that somebody in each place sees."""
    poses = _poses(waving, warp)
    return np.array(
        [_reach(waving.clerk, poses, reach_view(waving.clerk, c.name)) for c in places.CUSTOMERS]
    )


def _poses(waving: Waving, warp: WarpTrack | None) -> Frames:
    length = waving.end_s - waving.start_s
    times = waving.start_s + length * (np.arange(LOOKS) + 0.5) / LOOKS
    poses = [pose_of_waver(waving, float(t), warp) for t in times]
    return Frames(np.array([root for root, _ in poses]), np.array([turns for _, turns in poses]))


def _sharp_view(clerk: str, eye_m: Vector, viewer_place: str) -> Outlook:
    middle = places.place(clerk).floor_m + np.array(
        [0.0, places.SEAT_M + 0.1 + MIDDLE_ABOVE_HIPS_M, 0.0]
    )
    distance = float(np.linalg.norm(middle - eye_m))
    wide_deg = 2 * np.degrees(np.arcsin(VIEW_RADIUS_M / distance))
    return view_of(clerk, eye_m, viewer_place, round(PIXELS_PER_DEG * wide_deg))


@cache
def reach_view(clerk: str, place: str) -> Outlook:
    """Return what a customer of the usual height sees a clerk through."""
    return view_of(clerk, eye_at(place), place, REACH_PX)


def _seen_and_free(clerk: str, poses: Frames, view: Outlook) -> tuple[npt.NDArray[np.uint8], ...]:
    """Return the parts drawn in every pixel, and those drawn with nothing in between."""
    body = seen_body_of(clerk)
    return seen_and_free_parts(body, view, poses.root_m, poses.orientation_wxyz)


def _pixels(clerk: str, poses: Frames, view: Outlook) -> list[Vector]:
    counts = []
    for ids in _seen_and_free(clerk, poses, view):
        by_part = np.bincount(ids.ravel(), minlength=len(PARTS)) / LOOKS
        counts.append(np.array([by_part[mask_of(p)[: len(by_part)]].sum() for p in CUE_PARTS]))
    return counts


def _reach(clerk: str, poses: Frames, view: Outlook) -> float:
    mask = mask_of(REACH_PARTS)
    seen_px, free_px = (float(mask[ids].sum()) for ids in _seen_and_free(clerk, poses, view))
    return seen_px / max(free_px, 1.0)


def _bearing_deg(way: Vector) -> float:
    return float(np.degrees(np.arctan2(way[0], way[2])))


def _pointing(waving: Waving, poses: Frames, gaze: Vector) -> tuple[Vector, Vector]:
    """Return where the head is (3,), and the bearings (4,) of eyes, head, torso and palm."""
    skeleton = waving.clip.skeleton
    ahead, down = np.array([0.0, 0.0, -1.0]), np.array([0.0, -1.0, 0.0])
    head, front = np.zeros(3), np.zeros((3, 3))
    for root, turns in zip(poses.root_m, poses.orientation_wxyz, strict=True):
        body = forward(skeleton, root, turns)
        head += body.position_m[skeleton.index("head")] / LOOKS
        for k, (joint, axis) in enumerate(
            (("head", ahead), ("upper_chest", ahead), ("right_hand", down))
        ):
            front[k] += rotate(body.orientation_wxyz[skeleton.index(joint)], axis) / LOOKS
    return head, np.array([_bearing_deg(gaze), *(_bearing_deg(f) for f in front)])

"""The waves of the study: turned towards the addressee, or warped to the addressee's view.

A warped wave starts from a plan: offsets for eyes where the addressee is expected. It takes many
seconds to find and is kept, in memory and on the computer under the hash of everything it follows
from. For a participant a loop corrects it while it is seen
(`visavis.stimuli.motion.warping.track`).
"""

from collections.abc import Mapping
from dataclasses import astuple, dataclass, replace
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np

import visavis.stimuli.motion.warping
from visavis.lab.array_cache import digest_of, digest_of_code, read_cache, write_cache
from visavis.lab.geometry import Vector
from visavis.stimuli.dressing.casting import build_of
from visavis.stimuli.dressing.office import PARTS, unwarped_pose_of_waver
from visavis.stimuli.dressing.office_view import (
    STILL,
    character_of,
    drawn_clip,
    eye_at,
    heading_deg,
    seen_body_of,
    view_of,
)
from visavis.stimuli.motion.baking import bake
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.kinds import Wave
from visavis.stimuli.motion.people import Person
from visavis.stimuli.motion.warping.clips import warp_clip
from visavis.stimuli.motion.warping.control import ControlSettings, Situation
from visavis.stimuli.motion.warping.features import FeatureTarget
from visavis.stimuli.motion.warping.track import (
    Reached,
    WarpTrack,
    planned_track,
    reached_by,
    solve_offsets,
)
from visavis.stimuli.motion.warping.units import units_named
from visavis.stimuli.scenes import office as places
from visavis.stimuli.scenes.office import Waving

ORIENTATION: Final = "orientation"
WARPING: Final = "warping"
TECHNIQUES: Final = (ORIENTATION, WARPING)
"""The whole body turned towards the addressee, or the wave warped to the addressee's view."""
DIRECTIONS: Final = ("self", "left", "right")
"""Who is waved at: the participant, the customer to the left, the customer to the right."""
CLERK_NAMES: Final = [c.name for c in places.CLERKS]
PLACES: Final = tuple(c.name for c in places.CUSTOMERS)
SCENE_SEED: Final = 7
"""Of what everybody does beside the wave: the same in all trials."""
KEPT_AS: Final = "waving"
HAND: Final = "right"
SETTINGS: Final = ControlSettings(
    rate_hz=30.0, most_steps=4, probe_deg=6.0, step_cap_deg=10.0, error_cap=0.4, passes=5,
    smoothness=0.005, rest_pull=0.005, search=True,
)  # fmt: skip
"""Settings of a wave's plan, which has a key every 1 / `rate_hz` seconds."""
REFINING: Final = replace(SETTINGS, most_steps=3, step_cap_deg=2.0, search=False)
"""Settings of the refinement of a plan's keys after all of them have been solved together."""
LOOP: Final = replace(REFINING, most_steps=1)
"""Settings of the loop in the session: one step a key, at most 2° for a unit."""
FINE_PX: Final = 512
"""Height and width of the view in which keys are refined, corrected and reported. At the 256 of the
search a hand covers 260 pixels: its edges alone change its share by half of the tolerance, and keys
fitted to that miss the target in between.
"""
WARPED_PARTS: Final = (("face", "eyes"), ("right_hand",))
"""Parts with a target of coverage: the head by its face (a profile has more pixels), the hand."""
UNITS: Final = ("spine", "neck_head", "right_arm")
"""All warping units that move head or waving hand."""
FADE_S: Final = 0.5


@dataclass(frozen=True)
class Making:
    """Parameters of all waves: a wave lasts `wave_s` from `before_s` after the onset on.

    `increment` is how much more coverage of head and hand the warped wave shall have, `warp_from`
    what it starts from: the wave to the "front" as it was captured, or one "oriented", whole body,
    to the addressee.
    """

    before_s: float = 1.0
    wave_s: float = 2.6
    increment: float = 0.25
    warp_from: str = "front"


DEFAULT_MAKING: Final = Making()


@dataclass(frozen=True, eq=False)
class StudyWave:
    """One wave of the study; `plan_result` is what its plan reaches, None without a warp."""

    waving: Waving
    sha256: str
    plan_result: Reached | None


@cache
def study_wave(
    clerk: str,
    target_place: str,
    technique: str,
    making: Making = DEFAULT_MAKING,
    eye_height_m: float = places.STANDING_EYE_M,
) -> StudyWave:
    """Return how a clerk waves at somebody in a customer's place whose eyes are at a height.

    The same object for the same wave.
    """
    warps = technique == WARPING
    front = warps and making.warp_from == "front"
    heading = places.place(clerk).yaw_deg if front else heading_deg(clerk, target_place)
    clip = base_clip(clerk, making.wave_s)
    waving, plan_result = Waving(clerk, clip, heading, making.before_s, FADE_S), None
    if warps and making.increment > 0:
        eye_m = eye_at(target_place, eye_height_m)
        waving, plan_result = _with_plan(waving, target_place, eye_m, making.increment)
    omega = np.zeros(0) if waving.warp is None else waving.warp.omega_rad
    poses = (clip.root_m, clip.orientation_wxyz, omega)
    return StudyWave(
        waving, digest_of(*poses, text=f"turned by {heading:.6f} degrees"), plan_result
    )


def wave_of(factors: Mapping[str, Any], making: Making, eye_height_m: float) -> StudyWave:
    """Return the wave of a trial; one at the participant is made for their planned eye height."""
    is_own = factors["target_place"] == factors["participant_place"]
    clerk, target, technique = (str(factors[n]) for n in ("clerk", "target_place", "technique"))
    eyes_m = eye_height_m if is_own else places.STANDING_EYE_M
    return study_wave(clerk, target, technique, making, eyes_m)


@lru_cache(maxsize=8)
def base_clip(clerk: str, wave_s: float) -> Clip:
    """Return a clerk's wave straight ahead on their seat, from when the arm begins to rise."""
    number = tuple(PARTS).index(clerk)
    person = Person(
        build_of(character_of(clerk)), Wave(hand=HAND, seat_m=places.SEAT_M), 300 + number
    )
    return bake(person, FADE_S + wave_s, gaze=STILL)


def situation_of(
    waving: Waving, viewer_place: str, eye_m: Vector, t_s: float, increment: float
) -> Situation:
    """Return the unwarped pose at a time of the scene as eyes (3,) see it, with its targets."""
    view = view_of(waving.clerk, eye_m, viewer_place, FINE_PX)
    pose = unwarped_pose_of_waver(waving, t_s)  # by the same object, for its motion is made once
    return Situation(
        seen_body_of(waving.clerk), view, targets_of(increment), units_named(UNITS), *pose
    )


def targets_of(increment: float) -> tuple[FeatureTarget, ...]:
    """Return the targets of a warped wave."""
    return tuple(FeatureTarget("coverage", parts, increment) for parts in WARPED_PARTS)


def solved_key(
    about: tuple[str, str, Making], t_s: float, start_rad: Vector, eye_m: Vector
) -> Vector:
    """Return offsets (w,) for a key of a wave (clerk, target place, making) seen from eyes (3,)."""
    waving, place, increment = _wave_about(about)
    return solve_offsets(situation_of(waving, place, eye_m, t_s, increment), start_rad, LOOP)


def reached_in(
    about: tuple[str, str, Making], times_s: Vector, omega_rad: Vector, eyes_m: Vector
) -> Reached:
    """Return what offsets (n, w) of a wave came to at some times (n,), seen from eyes (n, 3)."""
    waving, place, increment = _wave_about(about)
    situations = (
        situation_of(waving, place, eye_m, float(t_s), increment)
        for t_s, eye_m in zip(times_s, eyes_m, strict=True)
    )
    return reached_by(situations, omega_rad)


@lru_cache(maxsize=64)
def _wave_about(about: tuple[str, str, Making]) -> tuple[Waving, str, float]:
    clerk, place, making = about
    bare = study_wave(clerk, place, WARPING, replace(making, increment=0.0)).waving
    return bare, place, making.increment


def _with_plan(
    waving: Waving, target_place: str, eye_m: Vector, increment: float
) -> tuple[Waving, Reached]:
    """Return a wave with offsets planned for eyes (3,), and what they come to."""
    clerk, clip = waving.clerk, waving.clip
    body, view = seen_body_of(clerk), view_of(clerk, eye_m, target_place)
    targets, units = targets_of(increment), units_named(UNITS)
    settings = (targets, UNITS, SETTINGS, REFINING, FINE_PX, waving.heading_deg, waving.start_s)
    view_arrays = (view.eye, view.behind, view.lighting.lamps, view.lighting.maps)
    key = digest_of(
        *(clip.root_m, clip.orientation_wxyz, body.rest, body.triangles, *view_arrays),
        text=f"{settings} {FADE_S} {clerk} {digest_of_code(visavis.stimuli.motion.warping)}",
    )
    file_arrays = read_cache(KEPT_AS, key)
    if file_arrays is None:
        clip_warp = warp_clip(drawn_clip(waving), body, view, targets, units, SETTINGS)
        track, came_to = planned_track(
            clip_warp,
            waving.start_s,
            waving.end_s,
            FADE_S,
            lambda t_s: situation_of(waving, target_place, eye_m, t_s, increment),
            REFINING,
        )
        file_arrays = {
            "omega_rad": track.omega_rad,
            "gap_s": np.array(track.gap_s),
            "numbers": np.array(astuple(came_to)),
        }
        write_cache(KEPT_AS, key, file_arrays)
    track = WarpTrack(
        units, waving.start_s, float(file_arrays["gap_s"]), file_arrays["omega_rad"], FADE_S
    )
    return replace(waving, warp=track), Reached(*map(float, file_arrays["numbers"]))

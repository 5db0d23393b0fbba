"""Which joint of a foreign skeleton is which of ours, from its names and its tree."""

import re
from collections.abc import Mapping

from stimuli.motion.errors import MotionError
from stimuli.motion.skeleton import Skeleton

_LIMBS = {
    "shoulder": ("shoulder", "clavicle", "collar"),
    "upper_arm": ("arm", "upperarm", "uparm", "humerus"),
    "lower_arm": ("forearm", "lowerarm", "lowarm", "radius", "elbow"),
    "hand": ("hand", "wrist"),
    "upper_leg": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "lower_leg": ("leg", "lowerleg", "lowleg", "tibia", "shin", "calf", "knee"),
    "foot": ("foot", "ankle"),
    "toes": ("toebase", "toes", "toe", "ball"),
    "eye": ("eye",),
}
_FINGERS = {"thumb": "thumb", "index": "index", "middle": "middle", "ring": "ring"}
_PHALANGES = ("proximal", "middle", "distal")
NEEDED = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")
)
"""Limb joints without which a motion cannot be carried over; hips and head are needed too."""


def _plain(name: str) -> str:
    """Return a name without prefix before a colon, blanks, dashes, dots, in lower case."""
    return re.sub(r"[\s_\-.]", "", name.rsplit(":", 1)[-1]).lower()


def _side(name: str) -> tuple[str, str] | None:
    """Split a name into side and part: LeftArm, l_arm, Arm_L, lfemur, right_hand."""
    bare = name.rsplit(":", 1)[-1]
    for side, letter in (("left", "l"), ("right", "r")):
        if _plain(bare).startswith(side):
            return side, _plain(bare)[len(side) :]
        if re.search(rf"[_\-.\s]{letter}$", bare, re.IGNORECASE):
            return side, _plain(bare)[:-1]
        if _plain(bare).startswith(letter):
            part = _plain(bare)[1:]
            if any(part in aliases for aliases in _LIMBS.values()):
                return side, part
    return None


def _limb(name: str) -> str | None:
    """Return our name for a limb or finger joint of the common conventions, or None."""
    split = _side(name)
    if split is None:
        return None
    side, part = split
    for limb, aliases in _LIMBS.items():
        if part in aliases or part == limb.replace("_", ""):
            return f"{side}_{limb}"
    match = re.fullmatch(
        r"(?:hand)?(thumb|index|middle|ring|pinky|little)(?:finger)?(\d|[a-z]+)", part
    )
    if match is None:
        return None
    finger = _FINGERS.get(match.group(1), "little")
    phalanx = match.group(2)
    if phalanx in ("1", "2", "3"):
        return f"{side}_{finger}_{_PHALANGES[int(phalanx) - 1]}"
    return f"{side}_{finger}_{phalanx}" if phalanx in _PHALANGES else None


def _chain(source: Skeleton, low: str, high: str) -> list[str]:
    """Return the joints strictly between two, from low to high; empty if not one above other."""
    chain = []
    at, end = int(source.parents[source.index(high)]), source.index(low)
    while at not in (end, -1):
        chain.append(source.names[at])
        at = int(source.parents[at])
    return chain[::-1] if at == end else []


def match_joints(source: Skeleton) -> Mapping[str, str]:
    """Return canonical joint names with the source's names for them.

    Limbs, head and fingers are known by name in the conventions of CMU, Mixamo, Bandai-Namco,
    Biovision and Visavis itself. Hips are the root or what both legs hang from; spine joints are
    told by their place between hips and arms, the neck by its place below the head.

    Raises:
        MotionError: a needed joint cannot be recognised.
    """
    found: dict[str, str] = {}
    for name in source.names:
        limb = _limb(name)
        if limb is not None:
            found.setdefault(limb, name)
        elif _plain(name) in ("head", "jaw"):
            found.setdefault(_plain(name), name)
    for side in ("left", "right"):
        # Biovision calls the upper arm Shoulder and the shoulder Collar.
        if f"{side}_upper_arm" not in found and f"{side}_lower_arm" in found:
            forearm = source.index(found[f"{side}_lower_arm"])
            upper = source.names[source.parents[forearm]]
            found[f"{side}_upper_arm"] = upper
            if found.get(f"{side}_shoulder") == upper:
                del found[f"{side}_shoulder"]
    missing = [j for j in (*NEEDED, "head") if j not in found]
    if missing:
        raise MotionError(
            f"joints not recognised: {', '.join(missing)}; among {', '.join(source.names)}. "
            "Pass joint_map with our names and yours"
        )
    found["hips"] = _common(source, found["left_upper_leg"], found["right_upper_leg"])
    arms = _common(source, found["left_upper_arm"], found["right_upper_arm"])
    torso = _chain(source, found["hips"], found["head"])
    if arms in torso:
        cut = torso.index(arms) + 1
        spine, neck = torso[:cut], torso[cut:]
    else:
        spine, neck = torso, []
    if len(spine) > 1:
        found["spine"] = spine[0]
    if len(spine) > 2:
        found["chest"] = spine[len(spine) // 2]
    if spine:
        found["upper_chest"] = spine[-1]
    if neck:
        found["neck"] = neck[-1]
    return found


def _common(source: Skeleton, a: str, b: str) -> str:
    """Return the lowest joint that both hang from."""
    above: set[int] = set()
    at = int(source.parents[source.index(a)])
    while at != -1:
        above.add(at)
        at = int(source.parents[at])
    at = int(source.parents[source.index(b)])
    while at not in above:
        if at == -1:
            raise MotionError(f"joints {a!r} and {b!r} hang from nothing in common")
        at = int(source.parents[at])
    return source.names[at]

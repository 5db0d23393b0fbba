"""Which joint of a foreign skeleton is which of ours, from its names and its tree."""

import re
from collections.abc import Mapping

from stimuli.motion.errors import MotionError
from stimuli.motion.skeleton import Skeleton, canonical_skeleton

CANONICAL_NAMES = canonical_skeleton().names

_LIMBS = {
    "shoulder": ("shoulder", "clavicle", "collar"),
    "upper_arm": ("arm", "upperarm", "uparm", "humerus"),
    "lower_arm": ("forearm", "lowerarm", "lowarm", "radius", "elbow"),
    "hand": ("hand", "wrist"),
    "upper_leg": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "lower_leg": ("leg", "lowerleg", "lowleg", "tibia", "shin", "calf", "knee"),
    "foot": ("foot", "ankle"),
    "toes": ("toebase", "toes", "toe", "toe0", "ball"),
    "eye": ("eye", "faceeye"),
}
_MIDDLE = {"head": "head", "jaw": "jaw", "mjaw": "jaw", "chead": "head"}
_RIG = re.compile(
    r"^(mixamorig\d*[:_]?|character\d*_|bip\d+[\s_]|j_(bip|adj|sec)_|def-)", re.IGNORECASE
)
"""What a rig puts before all its names: Mixamo, HumanIK, 3ds Max's Biped, VRoid, Rigify."""
_BIPED_FINGERS = ("thumb", "index", "middle", "ring", "little")
_FINGERS = {"thumb": "thumb", "index": "index", "middle": "middle", "ring": "ring"}
_PHALANGES = ("proximal", "middle", "distal")
NEEDED = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")
)
"""Limb joints without which a motion cannot be carried over; hips and head are needed too."""


def _bare(name: str) -> str:
    """Return a name without what its rig puts before all of them."""
    return _RIG.sub("", name.rsplit(":", 1)[-1])


def _plain(name: str) -> str:
    """Return a name without its rig's prefix, blanks, dashes and dots, in lower case."""
    return re.sub(r"[\s_\-.]", "", _bare(name)).lower()


def _side(name: str) -> tuple[str, str] | None:
    """Split a name into side and part: LeftArm, l_arm, Arm_L, lfemur, right_hand."""
    bare = _bare(name)
    for side, letter in (("left", "l"), ("right", "r")):
        if _plain(bare).startswith(side):
            return side, _plain(bare)[len(side) :]
        if re.search(rf"[_\-.\s]{letter}$", bare, re.IGNORECASE):
            return side, _plain(bare)[:-1]
        if _plain(bare).startswith(letter):
            part = _plain(bare)[1:]
            if any(part in aliases for aliases in _LIMBS.values()) or _finger(part):
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
    found = _finger(part)
    return None if found is None else f"{side}_{found}"


def _finger(part: str) -> str | None:
    """Return our name, without the side, of a finger's joint."""
    biped = re.fullmatch(r"finger([0-4])([12]?)", part)
    if biped is not None:
        phalanx = int(biped.group(2) or 0)
        return f"{_BIPED_FINGERS[int(biped.group(1))]}_{_PHALANGES[phalanx]}"
    match = re.fullmatch(
        r"(?:hand|f)?(thumb|index|middle|ring|pinky|little)(?:finger)?(0?\d|[a-z]+)", part
    )
    if match is None:
        return None
    finger, which = _FINGERS.get(match.group(1), "little"), match.group(2).lstrip("0")
    if which in ("1", "2", "3"):
        return f"{finger}_{_PHALANGES[int(which) - 1]}"
    return f"{finger}_{which}" if which in _PHALANGES else None


def _chain(source: Skeleton, low: str, high: str) -> list[str]:
    """Return the joints strictly between two, from low to high; empty if not one above other."""
    chain = []
    at, end = int(source.parents[source.index(high)]), source.index(low)
    while at not in (end, -1):
        chain.append(source.names[at])
        at = int(source.parents[at])
    return chain[::-1] if at == end else []


def match_joints(source: Skeleton, known: Mapping[str, str] | None = None) -> Mapping[str, str]:
    """Return canonical joint names with the source's names for them.

    Limbs, head and fingers are known by name in the conventions of CMU, Mixamo, Ready Player Me,
    HumanIK (VALID), 3ds Max's Biped (Rocketbox), VRoid, Rigify, Unreal, Bandai-Namco, Biovision
    and Visavis itself; `known` says of some which they are, over all else. Hips are the root or
    what both legs hang from; spine joints are told by their place between hips and arms, the neck
    by its place below the head.

    Raises:
        MotionError: a needed joint cannot be recognised, or `known` names one that is not there.
    """
    known = {} if known is None else known
    for ours, theirs in known.items():
        if ours not in CANONICAL_NAMES:
            raise MotionError(f"no joint of ours is called {ours!r}: {', '.join(CANONICAL_NAMES)}")
        if theirs not in source.names:
            raise MotionError(
                f"no joint {theirs!r}, said to be {ours}, among {', '.join(source.names)}"
            )
    for theirs in known.values():
        meant = [ours for ours, said in known.items() if said == theirs]
        if len(meant) > 1:
            raise MotionError(f"{' and '.join(meant)} are both said to be {theirs!r}")
    found: dict[str, str] = dict(known)
    for name in source.names:
        limb = _limb(name)
        if limb is not None:
            found.setdefault(limb, name)
        elif _plain(name) in _MIDDLE:
            found.setdefault(_MIDDLE[_plain(name)], name)
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
    legs = _common(source, found["left_upper_leg"], found["right_upper_leg"])
    found.setdefault("hips", legs)
    arms = _common(source, found["left_upper_arm"], found["right_upper_arm"])
    torso = _chain(source, found["hips"], found["head"])
    if arms in torso:
        cut = torso.index(arms) + 1
        if arms == torso[-1] and len(torso) > 1 and "neck" in _plain(arms):
            cut -= 1  # Biped hangs collar bones on the neck
        spine, neck = torso[:cut], torso[cut:]
    else:
        spine, neck = torso, []
    if len(spine) > 1:
        found.setdefault("spine", spine[0])
    if len(spine) > 2:
        found.setdefault("chest", spine[len(spine) // 2])
    if spine:
        found.setdefault("upper_chest", spine[-1])
    if neck:
        found.setdefault("neck", neck[-1])
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

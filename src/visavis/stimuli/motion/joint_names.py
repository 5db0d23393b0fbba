"""Match the joints of a foreign skeleton to ours, by their names and the tree."""

import re
from collections.abc import Mapping

from visavis.stimuli.motion.errors import MotionError, UnknownJointsError
from visavis.stimuli.motion.skeleton import Skeleton, canonical_skeleton

CANONICAL_NAMES = canonical_skeleton().names

_LIMBS = {
    "shoulder": ("shoulder", "clavicle", "collar"),
    "upper_arm": ("arm", "upperarm", "uparm", "humerus", "shldr"),
    "lower_arm": ("forearm", "lowerarm", "lowarm", "radius", "elbow"),
    "hand": ("hand", "wrist"),
    "upper_leg": ("upleg", "upperleg", "femur", "thigh", "hip"),
    "lower_leg": ("leg", "lowerleg", "lowleg", "tibia", "shin", "calf", "knee"),
    "foot": ("foot", "ankle"),
    "toes": ("toebase", "toes", "toe", "toe0", "ball"),
    "eye": ("eye", "faceeye", "eyesmplhf"),
}
_MIDDLE = {
    "head": "head", "chead": "head",
    "jaw": "jaw", "mjaw": "jaw", "jawroot": "jaw", "lowerjaw": "jaw",
}  # fmt: skip
_RIG = re.compile(
    r"^(mixamorig\d*[:_]?|character\d*_|bip\d+[\s_]|cc_base_|j_(bip|adj|sec)_|def-)",
    re.IGNORECASE,
)
"""Prefixes of all names in a rig: Mixamo, HumanIK, 3ds Max's Biped, Character Creator, VRoid,
Rigify.
"""
_ESCAPED = re.compile(r"FBXASC(\d{3})")
"""How Autodesk's exporters write characters that their format has no place for: by their code."""
_ENDING = re.compile(r"(?<=.)([._]\d+|[._\s]?(jnt|joint|jt|bone|bind|bn|sk))$", re.IGNORECASE)
_MIN_WITH_ENDING = 0.8
"""From this share on, numbers and words such as _JNT at the ends of names are not part of them:
Sketchfab and Blender put a number behind all, rigs the word joint or bone.
"""
_BIPED_FINGERS = ("thumb", "index", "middle", "ring", "little")
_FINGERS = {
    "thumb": "thumb", "index": "index", "middle": "middle", "mid": "middle", "ring": "ring",
}  # fmt: skip
_PHALANGES = ("proximal", "middle", "distal")
NEEDED = tuple(
    f"{side}_{part}"
    for side in ("left", "right")
    for part in ("upper_arm", "lower_arm", "hand", "upper_leg", "lower_leg", "foot")
)
"""Limb joints without which a motion cannot be carried over; hips and head are needed too."""


def _bare(name: str) -> str:
    """Return a name without what its rig puts before all of them."""
    spelt = _ESCAPED.sub(lambda code: chr(int(code.group(1))), name)
    return _RIG.sub("", spelt.rsplit(":", 1)[-1])


def _plain(name: str) -> str:
    """Return a name without its rig's prefix, blanks, dashes and dots, in lower case.

    Dashes between digits stay: they tell MakeHuman's fingers from Biped's.
    """
    return re.sub(r"[\s_.]|(?<!\d)-|-(?!\d)", "", _bare(name)).lower()


def _side(name: str) -> tuple[str, str] | None:
    """Split a name into side and part: LeftArm, l_arm, Arm_L, lfemur, right_hand, HIP_LEFT."""
    bare = _bare(name)
    for side, letter in (("left", "l"), ("right", "r")):
        if _plain(bare).startswith(side):
            return side, _plain(bare)[len(side) :]
        if _plain(bare).endswith(side):
            return side, _plain(bare).removesuffix(side)
        if re.search(rf"[_\-.\s]{letter}$", bare, re.IGNORECASE):
            return side, _plain(bare)[:-1]
        if _plain(bare).startswith(letter):
            part = _plain(bare)[1:]
            first = part.removesuffix("bend")
            if any(first in aliases for aliases in _LIMBS.values()) or _finger(part):
                return side, part
    return None


def _limb(name: str) -> str | None:
    """Return our name for a limb or finger joint of the common conventions, or None."""
    split = _side(name)
    if split is None:
        return None
    side, part = split
    # Daz and MakeHuman part limbs into two bones; the upper one begins at the joint.
    first = re.sub(r"(bend|01)$", "", part)
    for limb, aliases in _LIMBS.items():
        if {part, first} & {*aliases, limb.replace("_", "")}:
            return f"{side}_{limb}"
    finger = _finger(part)
    return None if finger is None else f"{side}_{finger}"


def _finger(part: str) -> str | None:
    """Return our name, without the side, of a finger's joint."""
    biped_match = re.fullmatch(r"finger([0-4])([12]?)", part)
    if biped_match is not None:
        phalanx = int(biped_match.group(2) or 0)
        return f"{_BIPED_FINGERS[int(biped_match.group(1))]}_{_PHALANGES[phalanx]}"
    makehuman = re.fullmatch(r"finger([1-5])-([1-3])", part)
    if makehuman is not None:
        which, joint = (int(number) - 1 for number in makehuman.groups())
        return f"{_BIPED_FINGERS[which]}_{_PHALANGES[joint]}"
    match = re.fullmatch(
        r"(?:hand|f)?(thumb|index|middle|mid|ring|pinky|little)(?:finger)?(0?\d|[a-z]+)", part
    )
    if match is None:
        return None
    finger, end = _FINGERS.get(match.group(1), "little"), match.group(2).lstrip("0")
    if end in ("1", "2", "3"):
        return f"{finger}_{_PHALANGES[int(end) - 1]}"
    return f"{finger}_{end}" if end in _PHALANGES else None


def _chain(source: Skeleton, low: str, high: str) -> list[str]:
    """Return the joints strictly between two, from low to high; empty if not one above other."""
    chain = []
    at, end = int(source.parents[source.index(high)]), source.index(low)
    while at not in (end, -1):
        chain.append(source.names[at])
        at = int(source.parents[at])
    return chain[::-1] if at == end else []


def _without_endings(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names without the number or word that stands behind nearly all of them."""
    while sum(_ENDING.search(n) is not None for n in names) >= _MIN_WITH_ENDING * len(names):
        names = tuple(_ENDING.sub("", name) for name in names)
    return names


def match_joints(
    source: Skeleton, joint_names: Mapping[str, str] | None = None
) -> Mapping[str, str]:
    """Return canonical joint names with the source's names for them.

    Limbs, head and fingers are known by name in the conventions of CMU, Mixamo, Ready Player Me,
    HumanIK (VALID), 3ds Max's Biped (Rocketbox), Character Creator, Daz, MakeHuman, SMPL-X, VRoid,
    VRChat, Rigify, Unreal, Bandai-Namco, Biovision, Kinect, ZED and Visavis itself, also where an
    exporter has numbered all of them or put a word such as _JNT behind them.
    `joint_names` names some of them and comes before every convention. The
    hips are the joint that both legs and the head hang from; spine joints are recognised by their
    place between hips and arms, the neck by its place below the head.

    Raises:
        MotionError: a needed joint cannot be recognised, or one of `joint_names` is not there.
    """
    joint_names = {} if joint_names is None else joint_names
    for ours, theirs in joint_names.items():
        if ours not in CANONICAL_NAMES:
            raise MotionError(f"no joint of ours is called {ours!r}: {', '.join(CANONICAL_NAMES)}")
        if theirs not in source.names:
            raise MotionError(
                f"no joint {theirs!r}, said to be {ours}, among {', '.join(source.names)}"
            )
    for theirs in joint_names.values():
        claims = [ours for ours, their_name in joint_names.items() if their_name == theirs]
        if len(claims) > 1:
            raise MotionError(f"{' and '.join(claims)} are both said to be {theirs!r}")
    matches: dict[str, str] = dict(joint_names)
    second: dict[str, str] = {}
    for name, spelt in zip(source.names, _without_endings(source.names), strict=True):
        limb = _limb(spelt)
        if limb is not None:
            if matches.setdefault(limb, name) != name:
                second.setdefault(limb, name)
        elif _plain(spelt) in _MIDDLE:
            matches.setdefault(_MIDDLE[_plain(spelt)], name)
    for side in ("left", "right"):
        # VRChat calls the thigh Leg and the shin Knee.
        thigh, shin = matches.get(f"{side}_lower_leg"), second.get(f"{side}_lower_leg")
        if f"{side}_upper_leg" not in matches and thigh is not None and shin is not None:
            if source.names[source.parents[source.index(shin)]] == thigh:
                matches |= {f"{side}_upper_leg": thigh, f"{side}_lower_leg": shin}
        # Biovision calls the upper arm Shoulder and the shoulder Collar.
        if f"{side}_upper_arm" not in matches and f"{side}_lower_arm" in matches:
            forearm = source.index(matches[f"{side}_lower_arm"])
            upper = source.names[source.parents[forearm]]
            matches[f"{side}_upper_arm"] = upper
            if matches.get(f"{side}_shoulder") == upper:
                del matches[f"{side}_shoulder"]
    missing = tuple(j for j in (*NEEDED, "head") if j not in matches)
    if missing:
        raise UnknownJointsError(missing, source.names)
    legs = _common(source, matches["left_upper_leg"], matches["right_upper_leg"])
    if "hips" not in matches:
        # Character Creator and Daz hang the legs from a pelvis of their own beside the spine.
        matches["hips"] = _common(source, legs, matches["head"])
    arms = _common(source, matches["left_upper_arm"], matches["right_upper_arm"])
    torso = _chain(source, matches["hips"], matches["head"])
    if arms in torso:
        cut = torso.index(arms) + 1
        if arms == torso[-1] and len(torso) > 1 and "neck" in _plain(arms):
            cut -= 1  # Biped hangs collar bones on the neck
        spine, neck = torso[:cut], torso[cut:]
    else:
        spine, neck = torso, []
    if len(spine) > 1:
        matches.setdefault("spine", spine[0])
    if len(spine) > 2:
        matches.setdefault("chest", spine[len(spine) // 2])
    if spine:
        matches.setdefault("upper_chest", spine[-1])
    if neck:
        matches.setdefault("neck", neck[-1])
    return matches


def _common(source: Skeleton, a: str, b: str) -> str:
    """Return the lowest joint that both hang from; the second may hang from the first."""
    above: set[int] = set()
    at = source.index(a)
    while at != -1:
        above.add(at)
        at = int(source.parents[at])
    at = int(source.parents[source.index(b)])
    while at not in above:
        if at == -1:
            raise MotionError(f"joints {a!r} and {b!r} hang from nothing in common")
        at = int(source.parents[at])
    return source.names[at]

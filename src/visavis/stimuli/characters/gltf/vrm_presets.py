"""Expressions of VRM files: which shapes of a mesh, by number, make a blink or a smile."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from visavis.stimuli.characters.gltf.file import GltfFile

PRESET: Final = "VRM preset "
"""What the names of shapes begin with that a file's presets bind by number."""
_OURS: Final[Mapping[str, tuple[str, float]]] = {
    "blink_l": ("left_blink", 1.0),
    "blinkleft": ("left_blink", 1.0),
    "blink_r": ("right_blink", 1.0),
    "blinkright": ("right_blink", 1.0),
    "blink": ("both_blink", 1.0),
    "lookup": ("lids_up", 1.0),
    "lookdown": ("lids_down", 1.0),
    "a": ("jaw_open", 1.0),
    "aa": ("jaw_open", 1.0),
    "joy": ("smile", 0.8),
    "happy": ("smile", 0.8),
}
"""Our shapes of the presets of VRM 0.x and 1.0, in small letters, and how much of each."""


def preset_amounts(file: GltfFile, node: int) -> dict[str, dict[int, float]]:
    """Return how much of which targets of the mesh of a node makes each of our shapes.

    A bind that names no target, or an amount that is no number, is left out: the figure is whole
    without it.
    """
    mesh = file.items("nodes")[node].get("mesh")
    amounts: dict[str, dict[int, float]] = {}
    for preset, is_by_node, bind in _binds(_parts(file.tree.get("extensions"))):
        is_here = bind.get("node") == node if is_by_node else bind.get("mesh") == mesh
        target, full = bind.get("index"), 1.0 if is_by_node else 100.0
        weight = bind.get("weight", full)
        if not isinstance(target, int) or not isinstance(weight, int | float):
            continue
        if not math.isfinite(weight):
            continue
        if is_here and preset.lower() in _OURS:
            ours, share = _OURS[preset.lower()]
            of_shape = amounts.setdefault(ours, {})
            of_shape[target] = of_shape.get(target, 0.0) + share * weight / full
    return amounts


def _binds(extensions: Mapping[str, Any]) -> Iterator[tuple[str, bool, Mapping[str, Any]]]:
    """Yield the preset of each bind, and whether it names a node (1.0) or a mesh (0.x)."""
    master = _parts(_parts(extensions.get("VRM")).get("blendShapeMaster"))
    for group in _items(master.get("blendShapeGroups")):
        for bind in _items(group.get("binds")):
            yield str(group.get("presetName", "")), False, bind
    expressions = _parts(_parts(extensions.get("VRMC_vrm")).get("expressions"))
    for name, expression in _parts(expressions.get("preset")).items():
        for bind in _items(_parts(expression).get("morphTargetBinds")):
            yield str(name), True, bind


def _parts(value: object) -> Mapping[str, Any]:
    """Return an object of the file; an empty one where something else stands."""
    return value if isinstance(value, Mapping) else {}


def _items(value: object) -> list[Mapping[str, Any]]:
    """Return the objects of a list of the file; none where something else stands."""
    return [_parts(one) for one in value] if isinstance(value, list) else []

"""Expressions of VRM files: which shapes of a mesh, by number, make a blink or a smile."""

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
    """Return how much of which targets of the mesh of a node makes each of our shapes."""
    mesh = file.items("nodes")[node].get("mesh")
    amounts: dict[str, dict[int, float]] = {}
    for preset, is_by_node, bind in _binds(file.tree.get("extensions") or {}):
        is_here = bind.get("node") == node if is_by_node else bind.get("mesh") == mesh
        if not is_here or preset.lower() not in _OURS:
            continue
        weight_01 = float(bind.get("weight", 1.0 if is_by_node else 100.0))
        weight_01 /= 1.0 if is_by_node else 100.0
        ours, share = _OURS[preset.lower()]
        of_shape, target = amounts.setdefault(ours, {}), int(bind["index"])
        of_shape[target] = of_shape.get(target, 0.0) + share * weight_01
    return amounts


def _binds(extensions: Mapping[str, Any]) -> Iterator[tuple[str, bool, Mapping[str, Any]]]:
    """Yield the preset of each bind, and whether it names a node (1.0) or a mesh (0.x)."""
    groups = extensions.get("VRM", {}).get("blendShapeMaster", {}).get("blendShapeGroups", [])
    for group in groups:
        for bind in group.get("binds") or ():
            yield str(group.get("presetName", "")), False, bind
    presets = extensions.get("VRMC_vrm", {}).get("expressions", {}).get("preset", {})
    for name, expression in presets.items():
        for bind in expression.get("morphTargetBinds") or ():
            yield name, True, bind

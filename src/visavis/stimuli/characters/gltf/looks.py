"""Materials of a glTF file: pictures, factors and texture coordinates."""

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.geometry import Vector
from visavis.stimuli.characters.character import Maps, Material, MaterialKind
from visavis.stimuli.characters.gltf.file import GltfFile

MAX_TEXTURE_PX = 4096
"""Larger pictures are halved; graphics cards of ten years ago take these."""
CLOTH_ROUGHNESS_01 = 0.85
"""Roughness of clothes that share one material with skin."""
SKIN_ROUGHNESS_01 = 0.6
"""Roughness of that skin; exporters' default shines white at the temples."""
UNCUT_01 = 0.5
"""Where the renderer cuts: alpha is scaled so that the file's own cutoff lies there."""
Pixels = npt.NDArray[np.uint8]
_WHITE: Final = np.full((1, 1, 3), 255, np.uint8)


@dataclass(frozen=True)
class _Slot:
    """A texture as a material uses it: number, set of coordinates, and where these are moved."""

    texture: int
    coordinates: int
    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    rotation_rad: float = 0.0

    def matrix(self) -> Vector:
        """Return (3, 3) for uv: KHR_texture_transform, offset · rotation · scale."""
        c, s = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        (ox, oy), (sx, sy) = self.offset, self.scale
        return np.array([[c * sx, s * sy, ox], [-s * sx, c * sy, oy], [0.0, 0.0, 1.0]])


def _slot(entry: dict[str, Any] | None) -> _Slot | None:
    if not entry:
        return None
    transform = entry.get("extensions", {}).get("KHR_texture_transform", {})
    coordinates = int(transform.get("texCoord", entry.get("texCoord", 0)))
    ox, oy = transform.get("offset", (0.0, 0.0))
    sx, sy = transform.get("scale", (1.0, 1.0))
    return _Slot(
        int(entry["index"]),
        coordinates,
        (float(ox), float(oy)),
        (float(sx), float(sy)),
        float(transform.get("rotation", 0.0)),
    )


def _slots(entry: dict[str, Any]) -> dict[str, _Slot]:
    """Return the textures of a material, the one that says how all lie first."""
    look = entry.get("pbrMetallicRoughness", {})
    sheen = entry.get("extensions", {}).get("KHR_materials_sheen", {})
    textures = {
        "base": look.get("baseColorTexture"),
        "normal": entry.get("normalTexture"),
        "surface": look.get("metallicRoughnessTexture"),
        "occlusion": entry.get("occlusionTexture"),
        "glow": entry.get("emissiveTexture"),
        "sheen": sheen.get("sheenColorTexture"),
    }
    slots = {name: _slot(texture) for name, texture in textures.items()}
    return {name: slot for name, slot in slots.items() if slot is not None}


def coordinates_of(file: GltfFile, material: int | None) -> tuple[int, Vector]:
    """Return the set of texture coordinates a material reads, and what moves them (3, 3)."""
    if material is not None:
        for slot in _slots(file.items("materials")[material]).values():
            return slot.coordinates, slot.matrix()
    return 0, np.eye(3)


def colour_factor(file: GltfFile, material: int | None) -> Vector:
    """Return the linear colour (3,) that a material gives everything it covers."""
    if material is None:
        return np.ones(3)
    look = file.items("materials")[material].get("pbrMetallicRoughness", {})
    return np.array(look.get("baseColorFactor", (1, 1, 1, 1))[:3], dtype=np.float64)


def shine_as_roughness(file: GltfFile) -> None:
    """Convert materials with specular colour and glossiness (older programs) to roughness.

    Such a material (KHR_materials_pbrSpecularGlossiness) is not metal, and as rough as its
    glossiness on the mean is low; one that is told in both ways stays as it is.
    """
    for entry in file.items("materials"):
        specular = entry.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if specular is None or entry.get("pbrMetallicRoughness"):
            continue
        glossiness = float(specular.get("glossinessFactor", 1.0))
        if "specularGlossinessTexture" in specular:
            pixels = file.image(specular["specularGlossinessTexture"]["index"])
            glossiness *= float(pixels[..., 3].mean()) / 255 if pixels.shape[2] == 4 else 1.0
        look = {"metallicFactor": 0.0, "roughnessFactor": 1.0 - glossiness}
        look["baseColorFactor"] = specular.get("diffuseFactor", (1, 1, 1, 1))
        if "diffuseTexture" in specular:
            look["baseColorTexture"] = specular["diffuseTexture"]
        entry["pbrMetallicRoughness"] = look


@dataclass(eq=False)
class Looks:
    """Materials of one file as ours; pictures that several share are read once and stay shared."""

    file: GltfFile
    _read: dict[tuple[object, ...], Pixels] = field(default_factory=dict)

    def material(self, index: int | None, kind: MaterialKind, *, is_shared: bool) -> Material:
        """Return a material of the file worn as `kind`; eyes are computed and have no pictures.

        `is_shared` says that the file's one material covers skin and clothes.
        """
        if index is None or kind == "eye":
            return Material(kind, kind if kind == "eye" else "other", 0.1 if kind == "eye" else 0.7)
        entry = self.file.items("materials")[index]
        look = entry.get("pbrMetallicRoughness", {})
        slots = _slots(entry)
        roughness = float(look.get("roughnessFactor", 1.0))
        metalness = float(look.get("metallicFactor", 1.0))
        if "surface" not in slots and is_shared:
            least = {"cloth": CLOTH_ROUGHNESS_01, "skin": SKIN_ROUGHNESS_01}
            roughness = max(roughness, least.get(kind, 0.0))
        maps = self._maps(entry, slots, roughness, metalness)
        base = self._base(entry, slots)
        if base is None and maps is not None:
            base = _WHITE
        return Material(
            f"{entry.get('name', 'material')}:{kind}",
            kind,
            roughness,
            base,
            bool(entry.get("doubleSided", False)),
            maps,
        )

    def pixels(self, index: int) -> Pixels:
        """Return a picture (h, w, 3 or 4) of the file, halved where it is too large."""
        key = ("picture", index)
        if key not in self._read:
            self._read[key] = _fitting(self.file.image(index))
        return self._read[key]

    def _base(self, entry: dict[str, Any], slots: dict[str, _Slot]) -> Pixels | None:
        mode = entry.get("alphaMode", "OPAQUE")
        factor = entry.get("pbrMetallicRoughness", {}).get("baseColorFactor", (1, 1, 1, 1))
        alpha = 1.0 if mode == "OPAQUE" else float(factor[3])
        if mode == "MASK":
            alpha *= UNCUT_01 / max(float(entry.get("alphaCutoff", 0.5)), 1 / 255)
        slot = slots.get("base")
        if slot is None:
            if mode == "OPAQUE" or alpha >= 1.0:
                return None
            return np.array([[[255, 255, 255, round(255 * alpha)]]], np.uint8)
        key = ("base", slot.texture, mode == "OPAQUE", alpha)
        if key not in self._read:
            pixels = self.pixels(slot.texture)
            if mode == "OPAQUE":
                pixels = _rgb(pixels)
            elif alpha != 1.0:
                if pixels.shape[2] == 3:
                    pixels = np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])
                pixels = pixels.copy()
                new_alpha = np.round(alpha * pixels[..., 3].astype(np.float64))
                pixels[..., 3] = np.clip(new_alpha, 0, 255)
            self._read[key] = pixels
        return self._read[key]

    def _maps(
        self, entry: dict[str, Any], slots: dict[str, _Slot], roughness: float, metalness: float
    ) -> Maps | None:
        extensions = entry.get("extensions", {})
        sheen = extensions.get("KHR_materials_sheen", {})
        strength = float(
            extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        )
        glow = strength * np.array(entry.get("emissiveFactor", (0, 0, 0)), dtype=np.float64)
        sheen_factor = np.array(sheen.get("sheenColorFactor", (0, 0, 0)), dtype=np.float64)
        maps = Maps(
            normal=self._normal(entry, slots),
            surface=self._surface(entry, slots, roughness, metalness),
            glow_srgb=self._tint("glow", slots, glow),
            sheen_srgb=self._tint("sheen", slots, sheen_factor),
        )
        pictures = (maps.normal, maps.surface, maps.glow_srgb, maps.sheen_srgb)
        return maps if any(picture is not None for picture in pictures) else None

    def _normal(self, entry: dict[str, Any], slots: dict[str, _Slot]) -> Pixels | None:
        slot = slots.get("normal")
        if slot is None:
            return None
        scale = float(entry["normalTexture"].get("scale", 1.0))
        key = ("normal", slot, scale)
        if key not in self._read:
            pixels = _rgb(self._lying(slot, slots))
            if scale != 1.0:
                leaning = pixels.astype(np.float32) - 127.5
                leaning[..., :2] *= scale
                leaning /= np.maximum(np.linalg.norm(leaning, axis=2, keepdims=True), 1e-6)
                pixels = np.round(127.5 + 127.5 * leaning).astype(np.uint8)
            self._read[key] = pixels
        return self._read[key]

    def _surface(
        self, entry: dict[str, Any], slots: dict[str, _Slot], roughness: float, metalness: float
    ) -> Pixels | None:
        """Return occlusion, roughness and metalness (h, w, 3); factors are in them."""
        rough, occlusion = slots.get("surface"), slots.get("occlusion")
        if rough is None and occlusion is None and metalness == 0.0:
            return None
        strength = float((entry.get("occlusionTexture") or {}).get("strength", 1.0))
        key = ("surface", rough, occlusion, roughness, metalness, strength)
        if key in self._read:
            return self._read[key]
        own_pixels = None if rough is None else self._lying(rough, slots)
        shade = None if occlusion is None else self._lying(occlusion, slots)
        shapes = [p.shape[:2] for p in (own_pixels, shade) if p is not None]
        height, width = max(shapes, default=(1, 1))
        out = np.full((height, width, 3), 255.0, np.float32)
        if shade is not None:
            shade_codes = _resize(shade, (height, width))[..., 0].astype(np.float32)
            out[..., 0] = 255.0 + strength * (shade_codes - 255.0)
        if own_pixels is not None:
            out[..., 1:] = _resize(own_pixels, (height, width))[..., 1:3]
        out[..., 1] *= roughness
        out[..., 2] *= metalness
        self._read[key] = np.round(np.clip(out, 0, 255)).astype(np.uint8)
        return self._read[key]

    def _tint(self, name: str, slots: dict[str, _Slot], factor: Vector) -> Pixels | None:
        """Return a picture of sRGB codes times a linear factor; None where that is black."""
        if not factor.any():
            return None
        slot = slots.get(name)
        key = (name, slot, tuple(factor.tolist()))
        if key not in self._read:
            pixels = _WHITE if slot is None else _rgb(self._lying(slot, slots))
            if not (factor == 1.0).all():
                codes = np.arange(256) / 255
                table = [np.round(255 * srgb_of(f * linear_of(codes))) for f in factor]
                pixels = np.dstack([table[k][pixels[..., k]] for k in range(3)]).astype(np.uint8)
            self._read[key] = pixels
        return self._read[key]

    def _lying(self, slot: _Slot, slots: dict[str, _Slot]) -> Pixels:
        """Return a picture as it must be to lie like the first one of its material."""
        pixels = self.pixels(slot.texture)
        first = next(iter(slots.values()))
        if replace(slot, texture=first.texture) == first or slot.coordinates != first.coordinates:
            return pixels
        height, width = pixels.shape[:2]
        u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        back = slot.matrix() @ np.linalg.inv(first.matrix())
        at = np.stack([u, v, np.ones_like(u)], axis=-1) @ back.T
        column = np.floor(at[..., 0] % 1.0 * width).astype(np.int64) % width
        row = np.floor(at[..., 1] % 1.0 * height).astype(np.int64) % height
        lying: Pixels = pixels[row, column]
        return lying


def linear_of(codes: Vector) -> Vector:
    """Return the light of sRGB codes from 0 to 1."""
    light: Vector = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    return light


def srgb_of(light: Vector) -> Vector:
    """Return the sRGB codes from 0 to 1 of light, clipped at 1."""
    x = np.clip(light, 0.0, 1.0)
    codes: Vector = np.where(
        x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-5) ** (1 / 2.4) - 0.055
    )
    return codes


def _fitting(pixels: Pixels) -> Pixels:
    factor = 1
    while max(pixels.shape[:2]) > MAX_TEXTURE_PX * factor:
        factor *= 2
    if factor == 1:
        return np.ascontiguousarray(pixels)
    return np.asarray(Image.fromarray(pixels).reduce(factor))


def _rgb(pixels: Pixels) -> Pixels:
    """Return a picture without its alpha; the very same where it has none."""
    return pixels if pixels.shape[2] == 3 else np.ascontiguousarray(pixels[..., :3])


def _resize(pixels: Pixels, shape: tuple[int, int]) -> Pixels:
    if pixels.shape[:2] == shape:
        return pixels
    size = (shape[1], shape[0])
    return np.asarray(Image.fromarray(pixels[..., :3]).resize(size, Image.Resampling.BILINEAR))

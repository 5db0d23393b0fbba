"""What a glTF file says of a surface is what is drawn: one feature of a material at a time."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from tests.stimuli.glb_figure import PLATE_AHEAD_M, Plate, write_glb
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.errors import StageError
from visavis.stage.renderer import Quality, Renderer
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.characters.gltf import import_gltf
from visavis.stimuli.characters.storage import read_character, write_character
from visavis.stimuli.picture import Camera, Light, Picture, PosedPeople, Room
from visavis.stimuli.rooms.plain import plain_room

Codes = npt.NDArray[np.float64]
Show = Callable[..., Codes]
GREY, WHITE, BLACK = (128, 128, 128), (255, 255, 255), (0, 0, 0)
RED, GREEN = (255, 0, 0), (0, 255, 0)
FROM_CAMERA, FROM_ABOVE = (0.0, 0.0, 1.0), (0.0, -0.7, 0.7)
HALF_WIDTH = 0.05
"""Of the view, at one metre: the middle half of the plate."""


def _plain(*rgb: tuple[int, ...]) -> npt.NDArray[np.uint8]:
    """Return a picture of columns, from left to right."""
    return np.repeat(np.repeat(np.array([rgb], np.uint8), 16, axis=0), 16, axis=1)


def _matte(**more: Any) -> dict[str, Any]:
    return {"baseColorFactor": [0.5, 0.5, 0.5, 1], "metallicFactor": 0, **more}


def _room(direction: tuple[float, float, float] | None, sky: float) -> Room:
    lights: tuple[Light, ...] = ()
    if direction is not None:
        lights = (Light("sun", np.full(3, 0.6), direction=np.array(direction)),)
    ambient = np.full(3, sky)
    return Room("dark", plain_room(()).props[:1], lights, ambient, ambient)


def _wearer(path: Path, plate: Plate) -> Character:
    """Return the figure as read from our own file, so that nothing is lost on the way."""
    write_glb(path / "plate_F.glb", plate=plate)
    write_character(import_gltf(path / "plate_F.glb"), path / "plate.npz")
    return read_character(path / "plate.npz")


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    try:
        made = Renderer(quality=Quality(samples=0, shadows="none"))
    except StageError as problem:
        pytest.skip(str(problem))
    with made:
        yield made


@pytest.fixture
def show(renderer: Renderer, tmp_path: Path) -> Show:
    """Draw the plate; return its mean codes (columns, 3), each of an equal share of its middle."""

    def shown(
        material: dict[str, Any],
        *pictures: npt.NDArray[np.uint8],
        light: tuple[float, float, float] | None = FROM_CAMERA,
        sky: float = 0.02,
        columns: int = 1,
        from_deg: float = 0.0,
        **plate: Any,
    ) -> Codes:
        person = _wearer(tmp_path, Plate(material, pictures, **plate))
        still = np.zeros((1, len(person.skeleton.names), 4))
        still[..., 0] = 1.0
        people = PosedPeople(np.zeros((1, 3)), still, np.zeros((1, len(MORPHS))))
        chest = person.skeleton.rest_m[person.skeleton.index("upper_chest")]
        turn = np.radians(from_deg)
        at = chest - np.array([np.sin(turn), 0.0, PLATE_AHEAD_M + np.cos(turn)])
        half = HALF_WIDTH * np.cos(turn)
        pose = Pose(at, quat_from_yaw_pitch_deg(180.0 + from_deg))
        camera = Camera(pose, -half, half, -half, half)
        picture = Picture(0, _room(light, sky), (person,), people)
        image = renderer.image(picture, camera, (32, 32)).astype(np.float64)
        mean: Codes = image.reshape(32, columns, -1, 3).mean(axis=(0, 2))
        return mean

    return shown


def test_normal_map_leans_the_surface_towards_and_away_from_the_light(show: Show) -> None:
    up, down = _plain((128, 218, 218)), _plain((128, 38, 218))
    looks = {
        name: show(
            {"pbrMetallicRoughness": _matte(), "normalTexture": {"index": 0}},
            picture,
            light=FROM_ABOVE,
        ).mean()
        for name, picture in (("up", up), ("flat", _plain((128, 128, 255))), ("down", down))
    }
    assert looks["up"] > looks["flat"] + 10
    assert looks["down"] < looks["flat"] - 20


@pytest.mark.parametrize("mapped", [False, True])
def test_specular_colour_and_glossiness_are_read_as_roughness(show: Show, mapped: bool) -> None:
    """Figures of older programs that tell nothing else came out white."""
    told: dict[str, Any] = {"diffuseFactor": [0.5, 0.5, 0.5, 1], "diffuseTexture": {"index": 0}}
    told["glossinessFactor"] = 0.4
    if mapped:
        told |= {"glossinessFactor": 0.8, "specularGlossinessTexture": {"index": 1}}
    half = np.full((16, 16, 4), 255, np.uint8)
    half[:, ::2, 3], half[:, 1::2, 3] = 0, 255
    pictures = (_plain(RED, GREEN), half)

    material: dict[str, Any] = {"extensions": {"KHR_materials_pbrSpecularGlossiness": told}}
    if mapped:
        material["pbrMetallicRoughness"] = {}  # some programs write it and mean nothing by it
    found = show(material, *pictures, columns=2)

    expected = _matte(baseColorTexture={"index": 0}, roughnessFactor=0.6)
    np.testing.assert_array_equal(
        found, show({"pbrMetallicRoughness": expected}, *pictures, columns=2)
    )
    assert found[0, 0] > 2 * found[0, 1]


def test_red_of_a_normal_map_leans_to_the_right_of_the_picture(show: Show) -> None:
    material = {"pbrMetallicRoughness": _matte(), "normalTexture": {"index": 0}}
    # The lamp stands to the right of who looks at the plate: its light travels towards +x, as the
    # viewer looks along +z, with the right hand at −x.
    from_right = (0.7, 0.0, 0.7)
    right = show(material, _plain((218, 128, 218)), light=from_right).mean()
    left = show(material, _plain((38, 128, 218)), light=from_right).mean()
    assert right > left + 40


def test_scale_of_a_normal_map_says_how_far_it_leans(show: Show) -> None:
    picture = _plain((128, 218, 218))

    def at(scale: float) -> float:
        texture = {"index": 0, "scale": scale}
        return float(
            show(
                {"pbrMetallicRoughness": _matte(), "normalTexture": texture},
                picture,
                light=FROM_ABOVE,
            ).mean()
        )

    flat = show({"pbrMetallicRoughness": _matte(roughnessFactor=1.0)}, light=FROM_ABOVE).mean()
    assert abs(at(0.0) - flat) < 12 < at(1.0) - at(0.0)


def test_occlusion_darkens_what_comes_from_all_around_alone(show: Show) -> None:
    def under(light: tuple[float, float, float] | None, sky: float, strength: float) -> float:
        texture = {"index": 0, "strength": strength}
        material = {"pbrMetallicRoughness": _matte(), "occlusionTexture": texture}
        return float(show(material, _plain(BLACK), light=light, sky=sky).mean())

    assert under(None, 0.5, 1.0) < 3
    assert under(None, 0.5, 0.0) > 100
    assert under(None, 0.5, 1.0) < under(None, 0.5, 0.5) < under(None, 0.5, 0.0)
    assert under(FROM_CAMERA, 0.0, 1.0) > 100


def test_smooth_surface_mirrors_the_lamp_that_a_rough_one_spreads(show: Show) -> None:
    def with_green(green: int, factor: float) -> float:
        look = _matte(metallicRoughnessTexture={"index": 0}, roughnessFactor=factor)
        return float(show({"pbrMetallicRoughness": look}, _plain((0, green, 0))).mean())

    assert with_green(51, 1.0) > with_green(255, 1.0) + 15
    assert with_green(255, 0.2) == pytest.approx(with_green(51, 1.0), abs=2)


def test_metal_has_no_colour_but_in_what_it_mirrors(show: Show) -> None:
    def with_blue(blue: int) -> Codes:
        look = {
            "baseColorFactor": [0.8, 0.1, 0.1, 1],
            "roughnessFactor": 0.3,
            "metallicRoughnessTexture": {"index": 0},
        }
        picture = _plain((0, 255, blue))
        shown: Codes = show({"pbrMetallicRoughness": look}, picture, light=FROM_ABOVE)[0]
        return shown

    matte, metal = with_blue(0), with_blue(255)
    assert matte[0] > metal[0] + 40  # the lamp is not mirrored towards the eye


def test_emission_is_seen_in_the_dark(show: Show) -> None:
    material = {"emissiveFactor": [0.0, 0.5, 0.0], "pbrMetallicRoughness": _matte()}
    left, right = show(
        {**material, "emissiveTexture": {"index": 0}},
        _plain(WHITE, WHITE, BLACK, BLACK),
        light=None,
        sky=0.0,
        columns=2,
    )
    assert left == pytest.approx([0, 188, 0], abs=3)
    assert right.max() < 10  # its first pixel mixes both
    half = {"KHR_materials_emissive_strength": {"emissiveStrength": 0.5}}
    weaker = show({**material, "extensions": half}, light=None, sky=0.0)[0]
    assert weaker == pytest.approx([0, 137, 0], abs=3)


@pytest.mark.parametrize(("cutoff", "is_there"), [(0.3, True), (0.6, False)])
def test_mask_is_cut_where_the_file_says(show: Show, cutoff: float, is_there: bool) -> None:
    look = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    material = {"pbrMetallicRoughness": look, "alphaMode": "MASK", "alphaCutoff": cutoff}
    red = show(material, _plain((255, 0, 0, 115)), columns=1)[0]
    assert (red[0] > 150 and red[1] < 60) == is_there


def test_opaque_material_has_no_holes_whatever_its_picture_says(show: Show) -> None:
    look = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    red = show({"pbrMetallicRoughness": look}, _plain((255, 0, 0, 10)))[0]
    assert red[0] > 150 > 60 > red[1]


def test_colours_of_vertices_multiply(show: Show) -> None:
    look = {"metallicFactor": 0, "baseColorFactor": [1, 1, 0.5, 1]}
    bare = show({"pbrMetallicRoughness": look})[0]
    coloured = show({"pbrMetallicRoughness": look}, colours=(1.0, 0.0, 1.0))[0]
    assert coloured == pytest.approx([bare[0], coloured[1], bare[2]], abs=2)
    assert coloured[1] < 0.4 * bare[1]


def test_texture_is_moved_as_the_file_says(show: Show) -> None:
    def lying(**moved: Any) -> Codes:
        texture = {"index": 0, "extensions": {"KHR_texture_transform": moved}}
        look = {"baseColorTexture": texture, "metallicFactor": 0}
        return show(
            {"pbrMetallicRoughness": look},
            _plain(RED, RED, GREEN, GREEN),
            columns=2,
            extensions=("KHR_texture_transform",),
        )

    left, right = lying()
    assert left[0] > 2 * left[1]
    assert right[1] > 2 * right[0]
    left, right = lying(offset=[0.5, 0.0])
    assert left[1] > 2 * left[0]
    assert right[0] > 2 * right[1]
    left, right = lying(scale=[0.5, 1.0])
    assert left[0] > 2 * left[1]
    assert right[0] > 2 * right[1]
    left, right = lying(rotation=np.pi, offset=[1.0, 1.0])
    assert left[1] > 2 * left[0]


def test_map_moved_unlike_the_colour_lies_where_the_file_says(show: Show) -> None:
    texture = {"index": 1, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.0]}}}
    left, right = show(
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0},
            "emissiveTexture": texture,
            "emissiveFactor": [1, 1, 1],
        },
        _plain(BLACK),
        _plain(RED, RED, GREEN, GREEN),
        light=None,
        sky=0.0,
        columns=2,
    )
    assert left[1] > 100 > left[0]
    assert right[0] > 100 > right[1]


def test_texture_reads_the_set_of_coordinates_it_names(show: Show) -> None:
    look = {"baseColorTexture": {"index": 0, "texCoord": 1}, "metallicFactor": 0}
    left, right = show(
        {"pbrMetallicRoughness": look}, _plain(RED, RED, GREEN, GREEN), columns=2, uv_set=1
    )
    assert left[0] > 2 * left[1]
    assert right[1] > 2 * right[0]


def test_light_bleeds_round_skin_and_not_round_a_suit(show: Show) -> None:
    """Suits of files that call everything a body shone and blushed like skin."""
    grazing = (0.0, -1.0, 0.05)

    def red_over_blue(name: str) -> float:
        material = {"name": name, "pbrMetallicRoughness": _matte()}
        r, _, b = show(material, light=grazing)[0]
        return float(r - b)

    assert red_over_blue("suit") == pytest.approx(0.0, abs=1.0)
    assert red_over_blue("skin") > 10


def test_fibres_shine_towards_the_edge_of_what_is_seen(show: Show) -> None:
    sheen = {"KHR_materials_sheen": {"sheenColorFactor": [0.0, 0.0, 1.0]}}

    def blue_over_red(from_deg: float) -> float:
        material = {"pbrMetallicRoughness": _matte(), "extensions": sheen}
        r, _, b = show(material, light=None, sky=0.3, from_deg=from_deg)[0]
        return float(b - r)

    assert blue_over_red(0.0) < 3
    assert blue_over_red(70.0) > 15


def test_pictures_keep_their_size_and_are_kept_once(tmp_path: Path) -> None:
    large = np.zeros((4, 2048, 3), np.uint8)
    look = {"baseColorTexture": {"index": 0}, "metallicFactor": 0}
    material = {
        "pbrMetallicRoughness": look,
        "emissiveTexture": {"index": 0},
        "emissiveFactor": [1, 1, 1],
    }
    person = _wearer(tmp_path, Plate(material, (large,)))
    worn = next(m for m in person.materials if m.texture_srgb is not None)
    assert worn.texture_srgb is not None
    assert worn.texture_srgb.shape == (4, 2048, 3)
    assert worn.maps is not None
    assert worn.maps.glow_srgb is worn.texture_srgb

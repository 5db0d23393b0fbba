"""Pictures against stored ones, by what an eye would notice.

Stored pictures were drawn by Mesa's processor driver (llvmpipe). After a change that is meant to
be seen, look at the new ones and store them again:

    python -m tests.stage.test_golden [NAME ...]
"""

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from tests.stage import figures
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.card.context import draws_on_processor
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, ON_PROCESSOR, Quality, Renderer
from visavis.stimuli.dressing.audience import audience_picture
from visavis.stimuli.dressing.station import station_picture
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.scenes import audience as seats
from visavis.stimuli.scenes import station_crowd

FOLDER = Path(__file__).parent.parent / "golden" / "stage"
SIZE_PX = (240, 160)
MEAN_LAB, WORST_LAB = 1.5, 12.0
"""Most colour difference (CIE76) after blurring: mean of the picture, and worst hundredth of its
pixels, where a moved arm shows. 2.3 is just noticeable."""
CAST_MEAN_LAB, CAST_WORST_LAB = 2.3, 20.0
"""The same for scenes with the shipped cast, whose hair or cloth may be improved."""
BLUR_PX = 3
PLAIN = Quality(samples=0)


def _seen_from(x: float, y: float, z: float, yaw_deg: float, pitch_deg: float) -> Camera:
    pose = Pose(np.array([x, y, z]), quat_from_yaw_pitch_deg(yaw_deg, pitch_deg))
    return Camera(pose, -0.75, 0.75, -0.5, 0.5)


def _people() -> tuple[Picture, Camera]:
    return figures.picture(5), figures.camera(aspect=1.5)


def audience() -> tuple[Picture, Camera]:
    names = [f"{g}_{i:02d}" for g, n in (("female", 6), ("male", 5)) for i in range(1, n + 1)]
    scene = seats.audience_scene(names)
    towards = np.array([seats.PARTICIPANT_EYE_M - a.eye_centre_m for a in scene.agents])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    frame = SceneFrame(scene, 2_000_000_000, towards, np.ones(len(names)))
    return audience_picture(frame), _seen_from(*seats.PARTICIPANT_EYE_M, 4.0, -4.0)


def station() -> tuple[Picture, Camera]:
    scene = station_crowd.CrowdScene("station", (), crowd=station_crowd.station_crowd(1))
    frame = station_crowd.CrowdFrame(
        scene, 0, np.zeros((0, 3)), np.zeros(0), crowd_t_ns=3_000_000_000, track=None
    )
    x, z = station_crowd.START_M
    return station_picture(frame), _seen_from(x - 0.4, 1.65, z + 1.2, -40.0, -8.0)


CASES: dict[str, tuple[Callable[[], tuple[Picture, Camera]], Quality]] = {
    "people": (_people, PLAIN),
    "people_lightest": (_people, LIGHTEST),
    "audience": (audience, ON_PROCESSOR),
    "station": (station, ON_PROCESSOR),
}


@cache
def _why_not() -> str | None:
    try:
        with Renderer() as renderer:
            if not draws_on_processor(renderer.context):
                return "stored pictures are Mesa's; set LIBGL_ALWAYS_SOFTWARE=1 to compare them"
    except StageError as problem:
        return str(problem)
    return None


def _drawn(name: str) -> npt.NDArray[np.uint8]:
    case, quality = CASES[name]
    picture, camera = case()
    with Renderer(quality=quality) as renderer:
        return renderer.image(picture, camera, SIZE_PX)


def _lab(srgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Return CIE L*a*b* (h, w, 3) of blurred sRGB (D65)."""
    x = srgb.astype(np.float64) / 255
    linear = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    for axis in (0, 1):
        shifts = range(-(BLUR_PX // 2), BLUR_PX // 2 + 1)
        linear = np.mean([np.roll(linear, k, axis) for k in shifts], axis=0)
    to_xyz = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    xyz = linear @ to_xyz.T / np.array([0.9505, 1.0, 1.089])
    root = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.stack(
        [116 * root[..., 1] - 16, 500 * (root[..., 0] - root[..., 1]),
         200 * (root[..., 1] - root[..., 2])], axis=-1,
    )  # fmt: skip


def difference(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> tuple[float, float]:
    """Return the mean colour difference, and that of the worst hundredth of the pixels."""
    apart = np.linalg.norm(_lab(a) - _lab(b), axis=2)
    return float(apart.mean()), float(np.percentile(apart, 99))


@pytest.mark.parametrize("name", CASES)
def test_picture_looks_as_it_was_stored(name: str) -> None:
    why_not = _why_not()
    if why_not is not None:
        pytest.skip(why_not)
    with Image.open(FOLDER / f"{name}.png") as stored:
        mean, worst = difference(np.asarray(stored.convert("RGB")), _drawn(name))
    has_cast = name in ("audience", "station")
    assert mean < (CAST_MEAN_LAB if has_cast else MEAN_LAB)
    assert worst < (CAST_WORST_LAB if has_cast else WORST_LAB)


def test_a_person_who_moved_a_hand_s_breadth_is_noticed() -> None:
    why_not = _why_not()
    if why_not is not None:
        pytest.skip(why_not)
    picture, camera = _people()
    picture.people.root_m[2, 0] += 0.1
    with Renderer(quality=PLAIN) as renderer, Image.open(FOLDER / "people.png") as stored:
        moved = renderer.image(picture, camera, SIZE_PX)
        _, worst = difference(np.asarray(stored.convert("RGB")), moved)
    assert worst > WORST_LAB


def test_pictures_alike_do_not_differ_and_a_shade_is_measured_as_such() -> None:
    grey = np.full((20, 20, 3), 119, np.uint8)
    assert difference(grey, grey) == (0.0, 0.0)
    assert difference(grey, grey + np.uint8(5))[0] == pytest.approx(2.0, abs=0.1)


def store(names: list[str]) -> None:
    """Draw pictures, all of them when none is named, and store them."""
    for name in names or CASES:
        Image.fromarray(_drawn(name)).save(FOLDER / f"{name}.png", optimize=True)
        sys.stdout.write(f"stored {name}\n")


if __name__ == "__main__":
    store(sys.argv[1:])

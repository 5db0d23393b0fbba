"""Count what is asked of the graphics driver, by listening where our code hands it over.

    GALLIUM_NOOP=1 python -m tests.stage.gl_counts

prints the counts of stereo frames at full quality. Mesa's no-op driver takes every call and draws
nothing: nothing is left to wait for.
"""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np

from tests.stage.test_golden import audience, station
from visavis.lab.geometry import Pose
from visavis.stage.card.gl_calls import GlCalls
from visavis.stage.card.targets import EyeTarget
from visavis.stage.drawn_stage import default_views, eye_camera
from visavis.stage.renderer import Renderer
from visavis.stimuli.picture import Camera, Picture

Scene = Callable[[], tuple[Picture, Camera]]
EYE_PX = (480, 540)
HIDDEN = ((-0.9, -1.0), (-0.6, -1.0), (-0.9, -0.6))
"""A corner that the lens hides, as a headset's does."""

COUNTED: dict[str, tuple[tuple[type, str], ...]] = {
    "draws": (
        (moderngl.VertexArray, "render"),
        (moderngl.VertexArray, "render_indirect"),
        (moderngl.VertexArray, "transform"),
        (GlCalls, "draw"),
    ),
    "binds": ((moderngl.Texture, "use"), (moderngl.TextureArray, "use")),
    "uploads": (
        (moderngl.Buffer, "write"),
        (moderngl.Texture, "write"),
        (moderngl.TextureArray, "write"),
        (GlCalls, "fill_srgb"),
        (GlCalls, "fill_smaller"),
    ),
    "made": tuple(
        (moderngl.Context, name)
        for name in (
            "buffer",
            "texture",
            "texture_array",
            "program",
            "vertex_array",
            "framebuffer",
            "renderbuffer",
            "depth_texture",
        )
    ),
}
"""What is counted as what. A stretch is not a call: one call draws any number of them."""


@contextmanager
def counted() -> Iterator[Counter[str]]:
    """Count draws, textures bound, uploads and things made until the block ends."""
    counts: Counter[str] = Counter()

    def listened(function: Callable[..., Any], kind: str) -> Callable[..., Any]:
        @wraps(function)
        def called(*args: Any, **kwargs: Any) -> Any:
            counts[kind] += 1
            return function(*args, **kwargs)

        return called

    patches = [
        patch.object(owner, name, listened(getattr(owner, name), kind))
        for kind, places in COUNTED.items()
        for owner, name in places
    ]
    for one in patches:
        one.start()
    try:
        yield counts
    finally:
        for one in patches:
            one.stop()


def frames(
    renderer: Renderer, targets: Sequence[EyeTarget], scene: Scene, levels: Sequence[int]
) -> list[Counter[str]]:
    """Draw a stereo frame for each level that the first person takes, the others at all three;
    return what each asked of the driver.
    """
    picture, camera = scene()
    head = Pose(camera.pose.position_m, camera.pose.orientation_wxyz)
    cameras = [eye_camera(head, eye) for eye in default_views()]
    everyone, asked = np.arange(len(picture.cast)) % 3, []
    for k, level in enumerate(levels):
        at = replace(picture, t_ns=picture.t_ns + k * 11_000_000)
        with counted() as counts:
            renderer.draw(at, cameras, targets, levels=np.array([level, *everyone[1:]]))
        asked.append(counts)
    return asked


def of_studies() -> dict[str, list[Counter[str]]]:
    """Return the counts of a first frame, two like it, and one in which somebody changes level;
    of the audience, of the station, and of the audience without its first person.
    """

    def fewer() -> tuple[Picture, Camera]:
        picture, camera = audience()
        people = picture.people
        left = replace(
            people,
            root_m=people.root_m[1:],
            orientation_wxyz=people.orientation_wxyz[1:],
            morphs_01=people.morphs_01[1:],
        )
        return replace(picture, cast=picture.cast[1:], people=left), camera

    scenes = {"stare": audience, "crowd": station, "stare, one fewer": fewer}
    levels = [0, 0, 0, 2]
    with Renderer() as renderer:
        eyes = [replace(eye, hidden=HIDDEN) for eye in default_views()]
        targets = [EyeTarget(renderer.context, EYE_PX, 4, eye) for eye in eyes]
        return {name: frames(renderer, targets, s, levels) for name, s in scenes.items()}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(of_studies()) + "\n")

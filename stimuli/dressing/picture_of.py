"""Any scene as a picture: the scene itself names what dresses it."""

import importlib
from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np

from lab.errors import DesignError
from stimuli.characters.character import MORPHS
from stimuli.picture import Picture, PosedPeople, Room
from stimuli.scene import SceneFrame

NOWHERE: Final = Room("nowhere", (), (), np.zeros(3), np.zeros(3))
NOBODY: Final = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))


def picture_of(frame: SceneFrame) -> Picture:
    """Return what a frame looks like; a scene that nothing dresses is dark but for its mark.

    Raises:
        DesignError: what dresses the scene cannot be imported.
    """
    scene = frame.scene
    if scene.dressed_by:
        return _dresser(scene.dressed_by)(frame)
    return Picture(
        frame.t_ns, NOWHERE, (), NOBODY, brightness_01=scene.brightness_01, mark_m=scene.mark_m
    )


@cache
def _dresser(dressed_by: str) -> Callable[[SceneFrame], Picture]:
    module, _, name = dressed_by.partition(":")
    try:
        found: Callable[[SceneFrame], Picture] = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise DesignError(
            f"nothing dresses this scene: {dressed_by!r} cannot be imported ({error}); write "
            "dressed_by as module:function"
        ) from error
    return found

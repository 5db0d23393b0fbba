"""Turn any scene into a picture; the scene names the function that does it."""

import importlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.stimuli.characters.character import MORPHS
from visavis.stimuli.own_room import DRAWN_ROOM
from visavis.stimuli.picture import Picture, PosedPeople, Room
from visavis.stimuli.scene import SceneFrame

NOWHERE: Final = Room("nowhere", (), (), np.zeros(3), np.zeros(3))
NOBODY: Final = PosedPeople(np.zeros((0, 3)), np.zeros((0, 55, 4)), np.zeros((0, len(MORPHS))))


def picture_of(frame: SceneFrame) -> Picture:
    """Return the picture of a frame; a scene without such a function is dark except for its mark.

    Raises:
        DesignError: what dresses the scene cannot be imported.
    """
    scene = frame.scene
    picture = Picture(
        frame.t_ns, NOWHERE, (), NOBODY, brightness_01=scene.brightness_01, mark_m=scene.mark_m
    )
    if scene.dressed_by:
        picture = named_function(scene.dressed_by, "dresses this scene")(frame)
    if scene.room is None:
        return picture
    room = named_function(DRAWN_ROOM, "draws a laboratory's room")(scene.room.as_drawn())
    return replace(picture, room=room)


@cache
def named_function(address: str, purpose: str) -> Callable[..., Any]:
    """Return the function that "module:function" names.

    Raises:
        DesignError: it cannot be imported; `purpose` says what nothing does then.
    """
    module, _, name = address.partition(":")
    try:
        function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise DesignError(
            f"nothing {purpose}: {address!r} cannot be imported ({error}); write it as "
            "module:function"
        ) from error
    return function

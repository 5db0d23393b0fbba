"""What pages draw live figures from: files by the SHA-256 of their content, made when needed."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, Final

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.running.film_store import FilmStore
from visavis.running.picture_store import PictureStore
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.flat import Image
from visavis.stimuli.motion.synthesis.blend_file import packed_examples
from visavis.stimuli.motion.synthesis.pose_distance import compared_joints
from visavis.stimuli.rooms.plain import plain_room
from visavis.study.films import Film
from visavis.study.live import Live, Near

PERSON_AHEAD_M: Final = 2.6


@dataclass(frozen=True, eq=False)
class LiveStore:
    """The files of a study's live figures: `assets` maps names to content."""

    lives: Sequence[Live]
    assets: dict[str, bytes] = field(default_factory=dict)

    def describe(self, live: Live, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a figure; simulated people need no files.

        Raises:
            DesignError: it is none of the study's, or its examples are for another body.
        """
        if live not in self.lives:
            raise DesignError(
                "a live figure was made anew in a trial; make each once, outside of the trial's "
                "function, so that it is loaded before"
            )
        description: dict[str, Any] = {
            "figure": self.lives.index(live),
            "light": _light(),
            "camera": {
                "is_free": live.camera == "free",
                "eye_m": list(live.eye_m),
                "aim_m": list(live.aim_m),
            },
        }
        if is_simulated:
            return description
        live.check_bodies()
        return description | {
            name: self._asset(data)
            for name, data in (
                ("person", _glb(live.character)),
                ("blend", packed_examples(live.examples, live.weights)),
                *([("beside", _glb(live.beside))] if live.beside else []),
            )
        }

    def _asset(self, data: bytes) -> dict[str, Any]:
        digest = hashlib.sha256(data).hexdigest()
        self.assets[digest] = data
        return {"name": digest, "bytes": len(data)}


@lru_cache(maxsize=32)
def _glb(character: str) -> bytes:
    # late: a server that shows films alone starts without what reads and writes figures
    from visavis.stimuli.characters.gltf.exporting import glb_of_character

    return glb_of_character(default_casting(character))


@lru_cache(maxsize=1)
def _light() -> Mapping[str, Any]:
    """Return the light of the room in which films show a person alone.

    There people stand 2.6 m ahead and face the viewer, here at the origin and face −z.
    """
    room = plain_room()

    def turned(vector: Vector | None, ahead_m: float) -> list[float] | None:
        if vector is None:
            return None
        return [-float(vector[0]), float(vector[1]), -float(vector[2]) - ahead_m]

    lamps = [
        {
            "kind": lamp.kind,
            "intensity": lamp.intensity.tolist(),
            "position_m": turned(lamp.position_m, PERSON_AHEAD_M),
            "direction": turned(lamp.direction, 0.0),
            "half_angle_deg": lamp.half_angle_deg,
        }
        for lamp in room.lights
    ]
    return {
        "sky": room.sky.tolist(),
        "ground": room.ground.tolist(),
        "background_srgb": list(room.background_srgb),
        "lamps": lamps,
    }


def page_files(
    films: FilmStore, lives: LiveStore, *, is_simulated: bool, pictures: PictureStore | None = None
) -> Callable[[Film | Live | Image], Mapping[str, Any]]:
    """Return what describes to a page whatever it shows, each thing once."""
    pictures = pictures or PictureStore((), films.study_folder)

    @cache
    def describe(shown: Film | Live | Image) -> Mapping[str, Any]:
        if isinstance(shown, Live):
            return lives.describe(shown, is_simulated=is_simulated)
        if isinstance(shown, Image):
            return pictures.describe(shown, is_simulated=is_simulated)
        return films.describe(shown, is_simulated=is_simulated)

    return describe


def until_on_page(live: Live, until: Near) -> dict[str, Any]:
    """Return when a page ends a step by itself."""
    return {
        "weights": until.shares(live.examples).tolist(),
        "within_m": until.within_m,
        "poses": until.poses,
        "joints": list(compared_joints(live.examples.skeleton)),
    }

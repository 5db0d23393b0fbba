"""What pages draw live figures from: files by the SHA-256 of their content, made when needed.

They are deflated (zlib), which `load` in `site/live.js` undoes.
"""

import hashlib
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.running.film_store import FilmStore
from visavis.running.picture_store import PictureStore
from visavis.running.sound_store import SoundStore
from visavis.stimuli.audible import Audible
from visavis.stimuli.dressing.casting import default_casting
from visavis.stimuli.flat import Image, Panorama, Video
from visavis.stimuli.motion.synthesis.blend_file import packed_examples
from visavis.stimuli.motion.synthesis.pose_distance import compared_joints
from visavis.stimuli.picture import Room
from visavis.stimuli.rooms.plain import plain_room
from visavis.study.films import Film, LiveFilm
from visavis.study.live import Live, Near

PERSON_AHEAD_M: Final = 2.6


@dataclass(frozen=True, eq=False)
class LiveStore:
    """The files of a study's live figures: `assets` maps names to content."""

    lives: Sequence[Live | LiveFilm]
    assets: dict[str, bytes] = field(default_factory=dict)

    def describe(self, live: Live, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a figure; simulated people need no files.

        Raises:
            DesignError: it is none of the study's, or its examples are for another body.
        """
        description: dict[str, Any] = {
            "figure": self._number_of(live),
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

    def describe_film(
        self, live: LiveFilm, films: FilmStore, *, is_simulated: bool = False
    ) -> dict[str, Any]:
        """Return what a page must know about a film that it draws; simulated people need no files.

        Raises:
            DesignError: it is none of the study's, or somebody in it has other joints.
        """
        # late, as for figures
        from visavis.running.live_film import live_film_files

        number = self._number_of(live)
        if is_simulated:
            return {"figure": number}
        files, lens = live_film_files(live.film, films), live.lens
        return {
            "figure": number,
            "light": _light_of(files.room, lambda vector, _: vector),
            "camera": {
                "is_free": False,
                "eye_m": list(lens.eye_m),
                "aim_m": list(lens.aim_m),
                "half_height_01": lens.half_height_01,
            },
            "seconds": live.film.seconds,
            "room": self._asset(files.room_file),
            "people": [
                {"person": self._asset(person), "poses": self._asset(poses)}
                for person, poses in zip(files.people, files.poses, strict=True)
            ],
        }

    def _number_of(self, live: Live | LiveFilm) -> int:
        if live not in self.lives:
            raise DesignError(
                "a live figure was made anew in a trial; make each once, outside of the trial's "
                "function, so that it is loaded before"
            )
        return self.lives.index(live)

    def _asset(self, data: bytes) -> dict[str, Any]:
        digest, content = _deflate(data)
        self.assets[digest] = content
        return {"name": digest, "bytes": len(content)}


@lru_cache(maxsize=1024)
def _deflate(data: bytes) -> tuple[str, bytes]:
    """Return a file as pages load it, after its SHA-256; made once for all sessions."""
    content = zlib.compress(data, 9)
    return hashlib.sha256(content).hexdigest(), content


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

    def in_page(vector: Vector, ahead_m: float) -> Vector:
        return np.array([-vector[0], vector[1], -vector[2] - ahead_m])

    return _light_of(plain_room(), in_page)


def _light_of(room: Room, in_page: Callable[[Vector, float], Vector]) -> Mapping[str, Any]:
    """Return the light of a room; `in_page` turns vectors to the axes of what is drawn in it."""

    def numbers(vector: Vector | None, ahead_m: float) -> list[float] | None:
        return None if vector is None else in_page(vector, ahead_m).tolist()

    lamps = [
        {
            "kind": lamp.kind,
            "intensity": lamp.intensity.tolist(),
            "position_m": numbers(lamp.position_m, PERSON_AHEAD_M),
            "direction": numbers(lamp.direction, 0.0),
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


def prepare_live_films(
    lives: Sequence[Live | LiveFilm],
    films: FilmStore,
    report_progress: Callable[[int, int], None],
) -> None:
    """Make the files of everything that pages draw as films, once in a process.

    `report_progress` is called with the number of films made and of all.
    """
    live_films = [live for live in lives if isinstance(live, LiveFilm)]
    report_progress(0, len(live_films))
    for count, live in enumerate(live_films, start=1):
        # late, as above
        from visavis.running.live_film import live_film_files

        live_film_files(live.film, films)
        report_progress(count, len(live_films))


def page_files(
    films: FilmStore,
    lives: LiveStore,
    *,
    is_simulated: bool,
    pictures: PictureStore | None = None,
    sounds: SoundStore | None = None,
) -> Callable[[Film | Live | LiveFilm | Image | Video | Panorama | Audible], Mapping[str, Any]]:
    """Return what describes to a page whatever it shows, each thing once."""
    pictures = pictures or PictureStore((), films.study_folder)

    @cache
    def describe(
        stimulus: Film | Live | LiveFilm | Image | Video | Panorama | Audible,
    ) -> Mapping[str, Any]:
        if isinstance(stimulus, LiveFilm):
            return lives.describe_film(stimulus, films, is_simulated=is_simulated)
        if isinstance(stimulus, Live):
            return lives.describe(stimulus, is_simulated=is_simulated)
        if isinstance(stimulus, Image | Video | Panorama):
            return pictures.describe(stimulus, is_simulated=is_simulated)
        if isinstance(stimulus, Audible):
            assert sounds is not None  # noqa: S101 - a study that plays sounds gives them
            return sounds.describe(stimulus, is_simulated=is_simulated)
        return films.describe(stimulus, is_simulated=is_simulated)

    return describe


def until_on_page(live: Live, until: Near) -> dict[str, Any]:
    """Return when a page ends a step by itself."""
    return {
        "weights": until.shares(live.examples).tolist(),
        "within_m": until.within_m,
        "poses": until.poses,
        "joints": list(compared_joints(live.examples.skeleton)),
    }

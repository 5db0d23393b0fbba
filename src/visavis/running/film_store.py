"""Films as files: drawn once from people, camera and seed, and kept under what they show.

A film's name is the SHA-256 of everything its pictures are made of: how everybody looks, their
pose in every frame, the room, its lamps and what moves in it, the camera (in every frame where it
moves), size and rate, and how it is drawn and encoded. So a film that was built before is found
again, and anything that changes what it shows makes another one.

Every computer draws films at the same quality, whether it has a graphics card or not. Drivers round
a few pixels differently, so which one drew a film stands beside it, and in recordings.
"""

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import astuple, dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
import platformdirs

from visavis.lab.array_cache import digest_of
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import ConfigError, DesignError
from visavis.lab.geometry import Pose
from visavis.lab.plain_files import parse_json, read_plain
from visavis.lab.version import version
from visavis.lab.yaml_lines import did_you_mean
from visavis.protocol.plan.experiment import no_progress
from visavis.running.film_edges import refuse_cut_off
from visavis.running.page.spoken_digits import spoken_digits
from visavis.running.sound_store import require_fit
from visavis.stage.film_sound import add_sound
from visavis.stimuli.characters.character import Character
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.film_file import kind_for_browsers
from visavis.stimuli.flat import picture_path
from visavis.stimuli.picture import Camera, Picture, Prop, Room
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.sound import Waveform, part_of, read_sound
from visavis.study.dry_run import still_view
from visavis.study.experiment import HANDS, StudyExperiment
from visavis.study.films import MIME, SOUND_MIME, Film, Lens
from visavis.study.responses import Keys
from visavis.study.scenes import Maker, StagedScene, Staging, stage

if TYPE_CHECKING:
    from visavis.stage.stills import Stills
    from visavis.study.moving_camera import FilmSeen

NAMED_KEYS: Final = (
    *"space trigger enter select left right up down".split(),
    *"tab escape backspace delete insert home end pageup pagedown shift".split(),
    *(f"arrow{way}" for way in ("left", "right", "up", "down")),
    *(f"f{number}" for number in range(1, 13)),
)
"""Keys of a page, besides those called as what they type; trigger is space, select is enter."""
ROLES_OF_PAGES: Final = ("sound", "responses", HANDS)
"""Roles that a page fills itself; hands only in a headset."""
FILM_VERSION: Final = "vp9 10"
"""Version of drawing and encoding: a new value makes every film again."""
FILM_QUALITY: Final[Mapping[str, Any]] = {
    "samples": 0,
    "shadows": "blobs",
    "fast": True,
    "shrink_factor": 2,
}
"""How films are drawn (`stage.renderer.Quality`): drawn twice as large and made small, people in
full detail by compiled loops.

With shadow maps and light at every pixel, a single person would take a processor seventeen times as
long; four samples a pixel take it twice as long as a picture of twice the width and height.
"""
ENCODING: Final[Mapping[str, str]] = {
    "crf": "18",
    "b": "0",
    "deadline": "realtime",
    "cpu-used": "6",
    "threads": "1",
    "row-mt": "0",
    "g": "30",
}
"""One thread, so that the same pictures give the same bytes."""
REPORT_EVERY: Final = 10
POSE_DECIMALS: Final = 6
MAX_HELD_POSES: Final = 1000
"""A film of at most so many poses, of one person in each of its pictures, is posed once to be
named, checked and drawn. A pose takes 2 kB, so what `_pictures_of` holds takes at most 64 MB.
"""
Image = npt.NDArray[np.uint8]
Draw = Callable[[Picture, Camera, tuple[int, int]], Image]
NO_POSE: Final = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True)
class FilmFile:
    """A film that was built: its file, the SHA-256 of it, and its size."""

    path: Path
    sha256: str
    size_bytes: int


@dataclass(frozen=True, eq=False)
class FilmStore:
    """The films of one study; built ones lie in the user's cache, or in `folder`."""

    makers: Mapping[str, Maker]
    study_folder: Path
    folder: Path = field(default_factory=lambda: cache_folder())

    def stage_film(self, film: Film) -> StagedScene:
        """Return the scene of a film."""
        return _stage_film(film, tuple(self.makers.items()), self.study_folder)

    def film_seen(self, film: Film) -> "FilmSeen":
        """Return what a film by a moving camera shows, found once in a process.

        Raises:
            DesignError: its camera stands still, or finds nobody to film.
        """
        return _film_seen(film, tuple(self.makers.items()), self.study_folder)

    def cameras(self, film: Film) -> Sequence[Camera]:
        """Return the camera of every picture of a film."""
        if isinstance(film.lens, Lens):
            return (camera_of(film.lens, film.size_px),) * film.frame_count
        return self.film_seen(film).cameras

    def name_of(self, film: Film) -> str:
        """Return the name of a film: the hash of what it shows."""
        return _name_of(self, film)

    def file_of(self, film: Film) -> FilmFile | None:
        """Return a film's file; None where it was not built, or is not what was built."""
        path = self.folder / f"{self.name_of(film)}.webm"
        try:
            built_digest = parse_json(read_plain(path.with_suffix(".json")))["sha256"]
            content = path.read_bytes()
        except (OSError, ValueError, KeyError, TypeError):
            return None
        digest = hashlib.sha256(content).hexdigest()
        return FilmFile(path, digest, len(content)) if built_digest == digest else None

    def drawn_by(self, film: Film) -> str:
        """Return what drew a built film: "unknown" where nothing says."""
        path = self.folder / f"{self.name_of(film)}.json"
        try:
            return str(parse_json(read_plain(path))["renderer"])
        except (OSError, ValueError, KeyError, TypeError):
            return "unknown"

    def missing(
        self, films: Sequence[Film], report_progress: Callable[[int, int], None]
    ) -> list[Film]:
        """Return the films that are not built; to find a film's name takes a second or so.

        `report_progress` is called with the number of films looked for and of all.
        """
        missing = []
        for count, film in enumerate(films):
            report_progress(count, len(films))
            if self.file_of(film) is None:
                missing.append(film)
        report_progress(len(films), len(films))
        return missing

    def build(self, films: Sequence[Film], report_progress: Callable[[int, int], None]) -> None:
        """Draw and encode the missing films; none if one of them cuts off a moving body.

        `report_progress` is called with the number of frames done and of all.

        Raises:
            DesignError: a film's still camera does not show somebody whole who moves.
        """
        missing = self.missing(films, no_progress)
        total, frames_done = sum(film.frame_count for film in missing), 0
        report_progress(0, total)
        if not missing:
            return
        for film in missing:
            self.check_edges(film)
        self.folder.mkdir(parents=True, exist_ok=True)
        with _film_stills() as stills:
            renderer = str(stills.renderer.context.info["GL_RENDERER"])
            for film in missing:
                for frames in self._write(film, stills.image, renderer):
                    if frames % REPORT_EVERY == 0:
                        report_progress(frames_done + frames, total)
                frames_done += film.frame_count
        report_progress(total, total)

    def describe(self, film: Film, *, is_simulated: bool = False) -> dict[str, Any]:
        """Return what a page must know about a film; simulated people need no file.

        Raises:
            ConfigError: it was not built.
        """
        # To hash what a film shows takes seconds; without a file its parameters are enough.
        words = repr(film) if film.voice is None else f"{film!r} {film.voice!r}"
        name = hashlib.sha256(words.encode()).hexdigest() if is_simulated else self.name_of(film)
        description = {
            "film": name,
            "seconds": film.frame_count / film.rate_hz,
            "frames": film.frame_count,
            "rate_hz": film.rate_hz,
            "width_px": film.size_px[0],
            "height_px": film.size_px[1],
            "mime": MIME if film.voice is None else SOUND_MIME,
            **({} if film.voice is None else {"sound": True}),
        }
        if is_simulated:
            return description | {"sha256": "", "bytes": 0}
        film_file = self.file_of(film)
        if film_file is None:
            raise ConfigError(
                f"film {name[:12]} of {film.scene.name} is not built; begin again, which builds it"
            )
        return description | {"sha256": film_file.sha256, "bytes": film_file.size_bytes}

    def frames(self, film: Film) -> Iterator[SceneFrame]:
        """Yield what every picture of a film shows."""
        staged_scene, last = self.stage_film(film), None
        for k in range(film.frame_count):
            t_ns = k * NS_PER_S // film.rate_hz
            last = staged_scene.frame(still_view(t_ns), t_ns) or last
            if last is None:
                raise ConfigError(f"scene {film.scene.name} shows nothing at its onset")
            yield replace(last, t_ns=t_ns)

    def pictures(self, film: Film) -> Iterator[Picture]:
        """Yield every picture of a film, to be drawn."""
        whole = _pictures_of(self, film)
        return (picture_of(frame) for frame in self.frames(film)) if whole is None else iter(whole)

    def sound_of(self, film: Film) -> Waveform | None:
        """Return what is heard with a film; None where it has no voice.

        Raises:
            DataError: its recording cannot be played, or is over by then.
        """
        voice = film.voice
        if voice is None:
            return None
        whole = read_sound(self.study_folder / voice.file)
        return part_of(whole, voice.from_s, film.frame_count / film.rate_hz)

    def check_edges(self, film: Film) -> None:
        """Refuse a film whose still camera cuts off a moving body, unless it may.

        Cameras that follow somebody choose what they show by the size of the shot.

        Raises:
            DesignError: naming the film and the parts of the body.
        """
        if isinstance(film.lens, Lens) and not film.may_crop:
            options = ", ".join(f"{n} {v}" for n, v in film.scene.options.items())
            name = f"{film.scene.name} ({options})" if options else film.scene.name
            camera = camera_of(film.lens, film.size_px)
            refuse_cut_off(name, list(self.pictures(film)), camera)

    def _write(self, film: Film, draw: Draw, renderer: str) -> Iterator[int]:
        import av

        path = self.folder / f"{self.name_of(film)}.webm"
        draft = path.with_name(f".{path.stem}.{os.getpid()}.webm")
        cameras = self.cameras(film)
        with av.open(str(draft), "w", options={"fflags": "+bitexact"}) as container:
            stream = container.add_stream("libvpx-vp9", rate=film.rate_hz, options=dict(ENCODING))
            stream.width, stream.height = film.size_px
            stream.pix_fmt = "yuv420p"
            stream.codec_context.thread_count = 1
            shots = zip(self.pictures(film), cameras, strict=True)
            for number, (picture, camera) in enumerate(shots, start=1):
                image = draw(picture, camera, film.size_px)
                frame = av.VideoFrame.from_ndarray(image, format="rgb24")
                container.mux(stream.encode(frame))
                yield number
            container.mux(stream.encode())
        if (sound := self.sound_of(film)) is not None:
            heard = draft.with_name(f".{path.stem}.{os.getpid()}.heard.webm")
            add_sound(draft, heard, sound)
            heard.replace(draft)
        digest = hashlib.sha256(draft.read_bytes()).hexdigest()
        about = {
            "sha256": digest,
            "scene": film.scene.name,
            "seconds": film.seconds,
            "visavis": version(),
            "made": FILM_VERSION,
            "renderer": renderer,
            "quality": dict(FILM_QUALITY),
            "encoding": dict(ENCODING),
        }
        note = draft.with_suffix(".json")
        note.write_text(json.dumps(about), encoding="utf-8")
        note.replace(path.with_suffix(".json"))
        draft.replace(path)


def film_store(experiment: StudyExperiment) -> FilmStore:
    """Return the films of a study.

    Raises:
        DesignError: its trials have steps that no page can show, or not in the headset that it may
            enter, or digits that it cannot say.
    """
    experiment.check_in_headset()
    if (film := next((one for one in experiment.panoramas if one.is_film), None)) is not None:
        raise DesignError(
            f"{experiment.name} shows {film.file} all around, and a page shows a Panorama of "
            "pictures, not of films; perform it before a monitor or in a headset of the laboratory "
            '(on="lab"), or show a picture of it'
        )
    if any("room" in read.rests_on for read in experiment.read.values()):
        raise DesignError(
            f"{experiment.name} shows a Room, which no page shows; perform it before a monitor or "
            'in a headset of the laboratory (on="lab"), or show a picture of it as an Image'
        )
    if experiment.has_gaze_windows:
        raise DesignError(
            f"{experiment.name} shows something through a window that follows gaze (reveal), and "
            "browsers give no page gaze; perform it before a monitor or in a headset of the "
            'laboratory (on="lab"), or let the window follow the pointer: reveal="pointer"'
        )
    if not all(read.fits_a_page for read in experiment.read.values()):
        variant = experiment.study.procedure.xr_variant
        raise DesignError(
            f"{experiment.name} cannot be performed on a page: its trials show scenes frame by "
            "frame, vibrate, or play a sound at a place (t.play), and a page shows and plays what "
            "t.show does without a condition, t.watch, t.ask, t.wait and t.dark. Perform it "
            "in the laboratory (visavis run), or show its scenes as films (t.watch)"
            + (f", or perform {variant}, its variant for headsets' browsers" if variant else "")
        )
    for video in experiment.videos:
        kind_for_browsers(picture_path(video, experiment.settings.folder))
    for audible in experiment.audibles:
        require_fit(audible, experiment.settings.seconds_of(audible))
    if "sound" in experiment.study.procedure.screening:
        spoken_digits(experiment.language, experiment.settings.folder)
    return _store_of(experiment, cache_folder())


def require_roles_of_pages(experiment: StudyExperiment) -> None:
    """Refuse to begin a session on a page of a study that needs what no page has, keys among it.

    Sessions that began are gone on with, and seen again, without this check.

    Raises:
        DesignError: naming the roles, gaze, or the first such key.
    """
    has = ROLES_OF_PAGES if experiment.headset_streams else ROLES_OF_PAGES[:-1]
    lacking = [role for role in experiment.needed_roles if role not in has]
    if lacking or experiment.needs_gaze:
        raise DesignError(
            f"{experiment.name} cannot be performed on a page: it needs "
            f"{', '.join(lacking) or 'gaze, by which it measures (looks_at, looks)'}, which no "
            'page has. Perform it in the laboratory (on="lab"), or make a study for pages without '
            "it: uses=(), calibrate=False, no needs= of it and no measures of gaze"
        )
    keys = [r for r in experiment.responses.values() if isinstance(r, Keys)]
    for key in (str(option) for response in keys for option in response.options):
        if key != key.lower() or (len(key) > 1 and key not in NAMED_KEYS):
            raise DesignError(
                f"{experiment.name} asks for the key {key!r}, which no press on a page would be"
                f"{did_you_mean(key.lower(), (*NAMED_KEYS, *ascii_lowercase))}; letters are small"
            )


@lru_cache(maxsize=4)
def _store_of(experiment: StudyExperiment, folder: Path) -> FilmStore:
    """Return one store for an experiment, which finds the name of a film once."""
    return FilmStore(experiment.settings.makers, experiment.settings.folder, folder)


@lru_cache(maxsize=32)
def _pictures_of(store: FilmStore, film: Film) -> tuple[Picture, ...] | None:
    """Return every picture of a film; None where they are too many to be held."""
    if film.frame_count > MAX_HELD_POSES:
        return None
    pictures = map(picture_of, store.frames(film))
    first = next(pictures)
    if film.frame_count * len(first.cast) > MAX_HELD_POSES:
        return None
    return (first, *pictures)


@lru_cache(maxsize=512)
def _name_of(store: FilmStore, film: Film) -> str:
    digest = hashlib.sha256()
    drawing = (*FILM_QUALITY.items(), *ENCODING.items())
    settings = (FILM_VERSION, drawing, film.size_px, film.rate_hz, film.frame_count, film.lens)
    digest.update(repr(settings).encode())
    if (sound := store.sound_of(film)) is not None:
        digest.update(sound.sha256.encode())
    if not isinstance(film.lens, Lens):
        digest.update(_rounded(store.film_seen(film).poses))
    for picture in store.pictures(film):
        parts = [*map(_look_of, picture.cast), _place_of(picture.room)]
        parts += [_thing_of(item.prop) for item in picture.moving]
        parts += [repr(replace(panel, pose=NO_POSE)) for panel in picture.panels]
        parts += [f"{picture.brightness_01:.6f}", "" if picture.mark_m is None else "marked"]
        digest.update(",".join(parts).encode())
        people = picture.people
        for values in people.parts_moved:
            digest.update(_rounded(values))
        poses = [item.pose for item in picture.moving] + [p.pose for p in picture.panels]
        for pose in poses:
            digest.update(_rounded(pose.position_m) + _rounded(pose.orientation_wxyz))
        if picture.mark_m is not None:
            digest.update(_rounded(picture.mark_m))
    return digest.hexdigest()


def _rounded(values: npt.ArrayLike) -> bytes:
    """Return numbers as bytes that do not depend on the last bits of a processor's arithmetic."""
    return (np.round(np.asarray(values, np.float64), POSE_DECIMALS) + 0.0).tobytes()


@lru_cache(maxsize=64)
def _place_of(room: Room) -> str:
    """Return the hash of how a room looks."""
    digest = hashlib.sha256(f"{room.name} {room.background_srgb}".encode())
    for prop in room.props:
        digest.update(_thing_of(prop).encode())
    for lamp in room.lights:
        digest.update(f"{lamp.kind} {lamp.half_angle_deg:.6f} {lamp.casts_shadow}".encode())
        for vector in (lamp.intensity, lamp.position_m, lamp.direction):
            digest.update(b"none" if vector is None else _rounded(vector))
    digest.update(_rounded(room.sky) + _rounded(room.ground))
    return digest.hexdigest()


@lru_cache(maxsize=512)
def _thing_of(prop: Prop) -> str:
    """Return the hash of how a thing looks, wherever it stands."""
    mesh, made_of = prop.mesh, prop.material
    text = f"{prop.name} {made_of.kind} {made_of.roughness_01:.6f} {made_of.double_sided} "
    text += f"{prop.emission_01:.6f} {prop.casts_shadow}"
    digest = hashlib.sha256(text.encode())
    for block in prop.blocks:
        digest.update(_rounded(np.hstack(astuple(block))))
    maps = () if made_of.maps is None else vars(made_of.maps).values()
    for array in (*vars(mesh).values(), made_of.texture_srgb, *maps):
        if isinstance(array, np.ndarray):
            digest.update(_rounded(array) if array.dtype.kind == "f" else array.tobytes())
    return digest.hexdigest()


@lru_cache(maxsize=64)
def _look_of(person: Character) -> str:
    """Return the hash of how somebody looks: a figure imported again has the same name."""
    arrays = [a for mesh in person.levels for a in vars(mesh).values()]
    arrays += [m.texture_srgb for m in person.materials]
    arrays += [a for m in person.materials if m.maps for a in vars(m.maps).values()]
    return digest_of(*(a for a in arrays if isinstance(a, np.ndarray)), text=person.name)


def cache_folder() -> Path:
    """Return the folder of built films, which all studies of this user share."""
    return platformdirs.user_cache_path("visavis") / "films"


def camera_of(lens: Lens, size_px: tuple[int, int]) -> Camera:
    """Return the camera of a lens that stands still."""
    height = lens.half_height_01
    width = height * size_px[0] / size_px[1]
    pose = Pose(np.array(lens.eye_m), lens.turn_wxyz)
    return Camera(pose, -width, width, -height, height)


def _stage_film(film: Film, makers: tuple[tuple[str, Maker], ...], folder: Path) -> StagedScene:
    staging = Staging(np.random.default_rng(film.seed), film.seconds, 0, folder)
    return stage(film.scene, staging, dict(makers))


@lru_cache(maxsize=128)
def _film_seen(film: Film, makers: tuple[tuple[str, Maker], ...], folder: Path) -> "FilmSeen":
    # The director of films, with its geometry, is loaded only where a camera moves.
    from visavis.study.moving_camera import film_scene

    return film_scene(film, _stage_film(film, makers, folder))


@contextmanager
def film_drawing() -> Iterator[Draw]:
    """Open what draws the pictures of films, in a size of (width, height) pixels: alike on a
    graphics card and without one.
    """
    with _film_stills() as stills:
        yield stills.image


def _film_stills() -> "Stills":
    # OpenGL is loaded only to draw films, not to name them, to serve them or for simulated people.
    from visavis.stage.renderer import Quality
    from visavis.stage.stills import Stills

    return Stills(Quality(**FILM_QUALITY))

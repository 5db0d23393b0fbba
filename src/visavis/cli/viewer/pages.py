"""Trials on a page as the viewer holds them: films as small pictures, questions, answers.

Small pictures are kept next to the films in the user's cache, under the hash of their content.
"""

import io
import os
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from PIL import Image

from visavis.cli.film.on_page import FilmPictures
from visavis.cli.viewer.models import Models
from visavis.lab.plain_files import unpacked
from visavis.running.film_store import film_drawing
from visavis.running.page.seen_trial import SeenStep, SeenTrial
from visavis.study.films import Film

PICTURES_PER_S: Final = 12
HEIGHT_PX: Final = 320
WEBP_QUALITY: Final = 72


def pages_of(
    trials: Sequence[SeenTrial],
    models: Models,
    second_of: Callable[[int, int], float],
    on_trial: Callable[[int, int], None] | None,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return steps of trials in order but those of flat stimuli, and the films that they show; each
    film is drawn once.
    """
    numbers: dict[Film, int] = {}
    films: list[dict[str, Any]] = []
    steps: list[dict[str, Any]] = []
    with film_drawing() as draw:
        for number, trial in enumerate(trials, start=1):
            pictures = FilmPictures(trial.store, HEIGHT_PX, draw)
            for step in (step for step in trial.steps if not step.parts):
                for film in step.films.values():
                    if film not in numbers:
                        numbers[film] = len(films)
                        films.append(_pack_film(film, pictures, models))
                steps.append(_step_data(trial, step, numbers, second_of))
            if on_trial is not None:
                on_trial(number, len(trials))
    return steps, films


def _pack_film(film: Film, pictures: FilmPictures, models: Models) -> dict[str, Any]:
    rate_hz = min(PICTURES_PER_S, film.rate_hz)
    seconds = film.frame_count / film.rate_hz
    count = max(1, round(seconds * rate_hz))
    name = f"{pictures.store.name_of(film)}-{HEIGHT_PX}-{rate_hz}-{WEBP_QUALITY}.zip"
    path = pictures.store.folder / "small" / name
    frames = _read(path, count)
    if frames is None:
        frames = []
        for k in range(count):
            content = io.BytesIO()
            picture = Image.fromarray(pictures.at(film, k / rate_hz))
            picture.save(content, "WEBP", quality=WEBP_QUALITY, method=3)
            frames.append(content.getvalue())
        _keep(path, frames)
    width, height = pictures.size_px(film)
    return {
        "seconds": seconds,
        "rate": rate_hz,
        "width": width,
        "height": height,
        "frames": [models.picture_file(frame) for frame in frames],
    }


def _read(path: Path, count: int) -> list[bytes] | None:
    """Return small pictures that were made before; None where they are not there, or not whole."""
    try:
        pictures = dict(unpacked(path))
    except (OSError, ValueError):
        return None
    names = [f"{k}.webp" for k in range(count)]
    return [pictures[name] for name in names] if pictures.keys() >= set(names) else None


def _keep(path: Path, frames: Sequence[bytes]) -> None:
    """Keep small pictures under the name of what their film shows, for the next page."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    with zipfile.ZipFile(draft, "w") as file:
        for k, frame in enumerate(frames):
            file.writestr(f"{k}.webp", frame)
    draft.replace(path)


def _step_data(
    trial: SeenTrial,
    step: SeenStep,
    numbers: dict[Film, int],
    second_of: Callable[[int, int], float],
) -> dict[str, Any]:
    part = int(trial.row["recording_part"])
    return {
        "trial": str(trial.row["trial_id"]),
        "t0": second_of(part, step.shown_ns),
        "t1": second_of(part, step.gone_ns),
        "on": second_of(part, step.films_on_ns),
        "films": [numbers[film] for film in step.films.values()],
        "caption": step.caption,
        "questions": [
            {
                "prompt": q.prompt,
                "options": [list(option) for option in q.options],
                "answer": q.answer,
                "at": None if q.answered_ns is None else second_of(part, q.answered_ns),
            }
            for q in step.questions
        ],
    }

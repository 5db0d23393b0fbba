"""A trial on a page, drawn again: its films in time, questions below, and answers as given."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from visavis.cli.preview.pictures import SIMULATED, add_label
from visavis.cli.recorded_trial import factors_of, trial_row
from visavis.lab.clock import NS_PER_S
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy
from visavis.running.film_store import Draw, FilmStore, film_drawing
from visavis.running.page.seen_trial import Question, SeenPart, SeenStep, seen_trial
from visavis.stage.movie import open_movie, picture_times_ns
from visavis.stimuli.dots import step_at
from visavis.stimuli.dressing.flat import AT_REST, box_px, reader_of, size_deg
from visavis.stimuli.dressing.picture_of import picture_of
from visavis.stimuli.flat import Dots, Video, picture_path
from visavis.stimuli.flat_pixels import moving_pixels, pixels_of
from visavis.stimuli.picture import Camera, Picture
from visavis.stimuli.scene import SceneFrame
from visavis.stimuli.text_font import font_for
from visavis.study.films import Film

Pixels = npt.NDArray[np.uint8]
FILM_SHARE: Final = 0.68
"""Height of films as a share of the picture's, at most."""
QUESTION_SHARE: Final = 0.125
"""Share of the height that a question with its options takes."""
BACK, INK, QUIET, ACCENT = (250, 250, 248), (30, 30, 32), (120, 122, 126), (38, 104, 173)
PLACEHOLDER: Final = "…"


class FilmPictures:
    """Pictures of a study's films, each made once: decoded from the file that was shown where it is
    still there, else drawn as it was.
    """

    def __init__(self, store: FilmStore, height_px: int, draw: Draw) -> None:
        self.store, self._height_px, self.draw = store, height_px, draw
        self._scenes: dict[Film, list[Picture]] = {}
        self._pixels_by_frame: dict[tuple[Film, int], Pixels] = {}

    def size_px(self, film: Film) -> tuple[int, int]:
        """Return width and height of a film's pictures here."""
        height = min(self._height_px, film.size_px[1])
        return max(1, round(height * film.size_px[0] / film.size_px[1])), height

    def at(self, film: Film, seconds: float) -> Pixels:
        """Return the picture that a film shows at a moment of it."""
        k = min(int(seconds * film.rate_hz + 1e-6), film.frame_count - 1)
        if (film, k) not in self._pixels_by_frame:
            if film not in self._scenes and not self._decoded(film):
                self._scenes[film] = list(self.store.pictures(film))
            if film in self._scenes:
                picture, camera = self._scenes[film][k], self.store.cameras(film)[k]
                self._pixels_by_frame[film, k] = self.draw(picture, camera, self.size_px(film))
        return self._pixels_by_frame[film, k]

    def _decoded(self, film: Film) -> bool:
        """Take the pictures of the film's file; tell whether it is there, and whole."""
        file = self.store.file_of(film)
        if file is None:
            return False
        import av

        with av.open(str(file.path)) as container:
            frames = [
                Image.fromarray(f.to_ndarray(format="rgb24")) for f in container.decode(video=0)
            ]
        if len(frames) < film.frame_count:
            return False
        for k, frame in enumerate(frames):
            self._pixels_by_frame[film, k] = np.asarray(frame.resize(self.size_px(film)))
        return True


def write_page_film(
    study: OpenedStudy,
    recording: Recording,
    trial_id: str,
    video: Path,
    *,
    clock: bool = True,
    size_px: tuple[int, int] = (960, 540),
    rate_hz: int = 25,
    seconds: float | None = None,
    on_frame: Callable[[int, int], None] | None = None,
) -> int:
    """Write the film of a trial on a page; return the number of pictures.

    Raises:
        UsageError: the session has no such trial.
        StageError: the film cannot be written, or nothing draws here.
    """

    def times_of(start_ns: int, end_ns: int) -> list[int]:
        if seconds is not None:
            end_ns = min(end_ns, start_ns + round(seconds * NS_PER_S))
        return picture_times_ns(start_ns, end_ns, rate_hz)

    label = page_label(recording, trial_id)
    count = 0
    with open_movie(video, size_px, rate_hz) as movie:
        for passed_s, image, n in page_pictures(study, recording, trial_id, times_of, size_px):
            caption = f"{label}  {passed_s:.1f} s" if clock else label
            movie.add(np.asarray(add_label(image, caption)))
            count += 1
            if on_frame is not None:
                on_frame(count, n)
    return count


def page_label(recording: Recording, trial_id: str) -> str:
    """Return the label under pictures of a trial."""
    row = trial_row(recording, trial_id)
    factors = ", ".join(str(row[name]) for name in factors_of(recording, trial_id))
    label = f"{recording.manifest.study} {recording.manifest.participant} {trial_id}  {factors}"
    return f"{SIMULATED}  ·  {label}" if recording.is_simulated else label


def page_pictures(
    study: OpenedStudy,
    recording: Recording,
    trial_id: str,
    times_of: Callable[[int, int], Sequence[int]],
    size_px: tuple[int, int],
) -> Iterator[tuple[float, Pixels, int]]:
    """Yield seconds since a trial's begin, the page's picture then, and the number of pictures, for
    the session times that `times_of` chooses between the trial's begin and end.

    Raises:
        UsageError: the session has no such trial.
        StageError: nothing draws here.
    """
    trial = seen_trial(study, recording, trial_row(recording, trial_id))
    start_ns, end_ns = trial.span_ns
    times = times_of(start_ns, end_ns)
    with film_drawing() as draw:
        share = film_share(max((len(step.questions) for step in trial.steps), default=0))
        films = FilmPictures(trial.store, round(share * size_px[1]), draw)
        for t_ns in times:
            image = page_picture(trial.step_at(t_ns), t_ns, films, size_px)
            yield (t_ns - start_ns) / NS_PER_S, image, len(times)


def film_share(questions: int) -> float:
    """Return the height of films, as a share of the picture's, that leaves room for questions."""
    return max(0.2, min(FILM_SHARE, 0.805 - QUESTION_SHARE * questions))


def page_picture(
    step: SeenStep | None, t_ns: int, films: FilmPictures, size_px: tuple[int, int]
) -> Pixels:
    """Return what a page showed at a time, laid out as the page does: caption, films, questions."""
    width, height = size_px
    page = Image.new("RGB", size_px, BACK)
    if step is None:
        return np.asarray(page)
    if step.parts:
        return np.asarray(_flat_page(step.parts, t_ns, films.draw, size_px))
    pen = ImageDraw.Draw(page)
    size = max(11, height // 28)
    font = font_for(step.caption, size)
    pen.text((width / 2, 0.045 * height), step.caption, INK, font, anchor="mm")
    images = [
        films.at(film, step.film_time_s(film, t_ns))
        for film in (step.films[place] for place in step.films)
        if t_ns >= step.films_on_ns
    ]
    gap = width // 60
    x = (width - sum(i.shape[1] for i in images) - gap * (len(images) - 1)) // 2
    for image in images:
        page.paste(Image.fromarray(image), (x, round(0.085 * height)))
        x += image.shape[1] + gap
    tall = max((image.shape[0] for image in images), default=0)
    y = 0.13 * height + tall if step.films else 0.3 * height
    for question in step.questions:
        y = _draw_question(pen, size, question, t_ns, y, width)
    return np.asarray(page)


def _flat_page(
    parts: Sequence[SeenPart], t_ns: int, draw: Draw, size_px: tuple[int, int]
) -> Image.Image:
    """Return the flat stimuli that were lit at a time: the page made small, its bars dark."""
    page = Image.new("RGB", size_px)
    part = next((p for p in parts if p.on_ns <= t_ns < p.off_ns), None)
    if part is None:
        return page
    seen = part.screen
    share = min(size_px[0] / seen.width_px, size_px[1] / seen.height_px)
    wide, high = round(seen.width_px * share), round(seen.height_px * share)
    screen = replace(seen, width_px=wide, height_px=high)
    small = Image.new("RGB", (wide, high), part.scene.background_srgb)
    if part.scene.panorama is not None:
        small = Image.fromarray(_around(part, t_ns, draw, (wide, high)))
    for item in part.scene.items:
        box = box_px(item.at_deg, size_deg(item, part.scene), screen)
        size = (box[2] - box[0], box[3] - box[1])
        elapsed_s = (t_ns - part.scene.moves_since_ns) / NS_PER_S
        if isinstance(item, Video):
            film = reader_of(picture_path(item, part.scene.folder), size)
            pixels = Image.fromarray(film.picture_at(elapsed_s))
        elif isinstance(item, Dots):
            step = step_at(item, elapsed_s)
            pixels = Image.fromarray(moving_pixels(item, size, step))
        else:
            pixels = Image.fromarray(pixels_of(item, size, part.scene.folder))
        small.paste(pixels, box[:2], pixels)
    page.paste(small, ((size_px[0] - wide) // 2, (size_px[1] - high) // 2))
    return page


def _around(part: SeenPart, t_ns: int, draw: Draw, size_px: tuple[int, int]) -> Pixels:
    """Return what a page showed of a panorama, through it as through a window, at a time."""
    eye = part.screen.view_from(AT_REST.position_m)
    alone = replace(part.scene, items=(), names=())
    edges = eye.tangent_left, eye.tangent_right, eye.tangent_bottom, eye.tangent_top
    nobody = np.zeros((0, 3)), np.zeros(0)
    frame = SceneFrame(alone, t_ns, *nobody, turned_deg=part.scene.turns.at(t_ns))
    return draw(picture_of(frame), Camera(AT_REST, *edges), size_px)


def _draw_question(
    pen: ImageDraw.ImageDraw, size: int, question: Question, t_ns: int, y: float, width: int
) -> float:
    """Write a question and its options; return where the next one begins."""
    line = 1.35 * size
    pen.text((width / 2, y), question.prompt, INK, font_for(question.prompt, size), anchor="mm")
    is_given = question.answered_ns is not None and t_ns >= question.answered_ns - MARK_NS
    labels = [label for _, label in question.options]
    is_chosen = [value == question.answer and is_given for value, _ in question.options]
    if not labels:
        labels, is_chosen = [question.answer or "" if is_given else PLACEHOLDER], [is_given]
    small = _fitting(pen, labels, width, size)
    widths = [pen.textlength(label, small) + 1.6 * small.size for label in labels]
    x = (width - sum(widths)) / 2
    for label, wide, is_filled in zip(labels, widths, is_chosen, strict=True):
        box = (x + 3, y + 0.75 * line, x + wide - 3, y + 1.85 * line)
        pen.rounded_rectangle(box, 5, ACCENT if is_filled else None, ACCENT if is_filled else QUIET)
        pen.text(
            (x + wide / 2, y + 1.3 * line), label, BACK if is_filled else INK, small, anchor="mm"
        )
        x += wide
    return y + 2.6 * line


MARK_NS: Final = NS_PER_S // 2
"""A page goes on with the answer, so the answer is marked this much earlier to be visible."""


def _fitting(pen: ImageDraw.ImageDraw, labels: Sequence[str], width: int, size: int) -> Any:
    """Return a font in which labels stand side by side."""
    text = "".join(labels)
    while size > 7:
        small = font_for(text, size)
        if sum(pen.textlength(t, small) + 1.6 * size for t in labels) < 0.96 * width:
            return small
        size -= 1
    return font_for(text, size)

"""What a speaker does as text, and pictures of somebody who gestures."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image, ImageDraw
from rich.table import Table

from visavis.analysis.statistics.power_estimates import proportion_interval
from visavis.cli.app import verbatim
from visavis.cli.warp_sheet import DAYLIGHT
from visavis.experiments.gestures.viewing import looks_of
from visavis.lab.clock import NS_PER_S
from visavis.running.film_store import camera_of, film_drawing
from visavis.stage.errors import StageError
from visavis.stage.film_sound import add_sound
from visavis.stage.movie import open_movie
from visavis.stage.stills import Stills
from visavis.stimuli.characters.character import MORPHS, Character
from visavis.stimuli.motion.build import build_of_character
from visavis.stimuli.motion.clip import Clip
from visavis.stimuli.motion.speaking.body_track import BodyTrack, measure_body
from visavis.stimuli.motion.speaking.gesture_script import GesturePhrase, GestureScript
from visavis.stimuli.motion.speaking.gesturing import gesture_arms
from visavis.stimuli.motion.speaking.lexemes import LEXEMES
from visavis.stimuli.motion.speaking.motion_measures import mean_jerk_mps3, posture_use
from visavis.stimuli.motion.speaking.mouth import Mouth, mouth_of
from visavis.stimuli.motion.speaking.performance import performed
from visavis.stimuli.motion.speaking.speaker import Delay, Speaker
from visavis.stimuli.motion.speaking.speech import Speech
from visavis.stimuli.motion.synthesis.phrase_posture import CLASSES, Part
from visavis.stimuli.picture import Picture, PosedPeople, Room
from visavis.stimuli.rooms import surfaces
from visavis.stimuli.rooms.furniture import level
from visavis.stimuli.text_font import font_for
from visavis.study.films import Lens

FILM_LENS: Final = Lens(eye_m=(0.45, 1.25, -3.4), aim_m=(0.0, 0.98, 0.0), half_height_01=0.34)
SHEET_LENS: Final = Lens(eye_m=(0.6, 1.35, -2.3), aim_m=(0.0, 1.2, 0.0), half_height_01=0.25)
"""The speaker stands at the origin and faces −z, where the cameras are."""
TILE_PX: Final = 200
LABEL_PX: Final = 22
COLUMNS: Final = 4
MOMENTS_S: Final = (0.7, 0.9, 1.2)
PARTS: Final[tuple[Part, ...]] = ("com", "yaw")
PART_NAMES: Final = {"com": "weight", "yaw": "hips"}
IN_PAIRS: Final = frozenset(
    "offer open_arms shrug weigh frame walls apart together gather calm".split()
)
"""Lexemes that the sheet shows with both hands."""


def speaker_summary(speaker: Speaker) -> dict[str, Any]:
    """Return transitions, rules and delays of a speaker with counts and 95 % intervals."""
    habits = speaker.habits
    delays = [getattr(speaker, name) for name in ("com_delay", "yaw_delay", "trunk_delay")]
    return {
        "takes": [take.name for take in speaker.takes],
        "minutes": sum(len(t.track.com) for t in speaker.takes) / 30 / 60,
        "phrases": len(speaker.phrases),
        "pieces_on_planted_feet": len(speaker.clips),
        "mean_phrase_s": speaker.mean_phrase_s,
        "transitions": {part: _transitions(speaker, part) for part in PARTS},
        "rules": {part: _rules(speaker, part) for part in PARTS},
        "min_support": habits.min_support,
        "min_confidence": habits.min_confidence,
        "delays_s": {
            name: {"mean": d.mean_s, "sd": d.sd_s, "n": d.n, "error": d.error_s}
            for name, d in zip(("weight", "hips", "spine"), delays, strict=True)
        },
    }


def _transitions(speaker: Speaker, part: Part) -> dict[str, Any]:
    """Return how often each class follows each, and of how many; a class that nothing follows is
    left out.
    """
    rows: dict[str, Any] = {}
    for before in CLASSES[part]:
        count = speaker.habits.follower_count(part, before)
        if not count:
            continue
        shares = speaker.habits.chain(part, before).tolist()
        rows[before] = {
            "n": count,
            "to": {
                after: {"share": share, "interval": _interval(round(share * count), count)}
                for after, share in zip(CLASSES[part], shares, strict=True)
            },
        }
    return rows


def _rules(speaker: Speaker, part: Part) -> list[dict[str, Any]]:
    """Return every rule that holds, the most confident first."""
    gestures = sorted({(p.hand, p.lexeme) for p in speaker.habits.phrases})
    rules: dict[tuple[str, str], dict[str, Any]] = {}
    for hand, lexeme in gestures:
        for rule in speaker.habits.rules(part, hand, lexeme):
            name = {"H": hand, "L": lexeme, "HL": f"{hand} {lexeme}"}[rule.by]
            rules[name, rule.posture] = {
                "gesture": name,
                "posture": rule.posture,
                "support": rule.with_gesture / len(speaker.habits.phrases),
                "confidence": rule.confidence,
                "n": rule.with_gesture,
                "interval": _interval(rule.with_posture, rule.with_gesture),
            }
    return sorted(rules.values(), key=lambda r: (-r["confidence"], r["gesture"]))


def _interval(hits: int, count: int) -> tuple[float, float]:
    interval = proportion_interval(hits, count)
    return interval.low, interval.high


def speaker_text(speaker: Speaker) -> Iterator[str]:
    """Yield what a speaker does, line by line."""
    about = speaker_summary(speaker)
    yield (
        f"{len(about['takes'])} takes, {about['minutes']:.1f} minutes, {about['phrases']} phrases "
        f"of {about['mean_phrase_s']:.2f} s on average; "
        f"{about['pieces_on_planted_feet']} of them on planted feet serve as motion"
    )
    for part in PARTS:
        yield f"{PART_NAMES[part]} at the end of a phrase, after the one before (95 % interval):"
        for before, row in about["transitions"][part].items():
            cells = (
                f"{after} {cell['share']:.2f} ({cell['interval'][0]:.2f}–{cell['interval'][1]:.2f})"
                for after, cell in row["to"].items()
            )
            yield f"  after {before:<7} {'  '.join(cells)}  n = {row['n']}"
    for part in PARTS:
        yield (
            f"rules for the {PART_NAMES[part]} (support from {about['min_support']:g}, confidence "
            f"from {about['min_confidence']:g}):"
        )
        for rule in about["rules"][part]:
            low, high = rule["interval"]
            yield (
                f"  {rule['gesture']:<16} -> {rule['posture']:<7} confidence "
                f"{rule['confidence']:.2f} ({low:.2f}–{high:.2f})  n = {rule['n']}"
            )
    yield _delay_line("weight comes to rest", speaker.com_delay, "the stroke's end")
    yield _delay_line("hips come to rest", speaker.yaw_delay, "the stroke's end")
    yield _delay_line("the spine begins to turn", speaker.trunk_delay, "the phrase's start")


def _delay_line(what: str, delay: Delay, since: str) -> str:
    if not delay.n:
        return f"{what}: no phrase shows when"
    side = "before" if delay.mean_s < 0 else "after"
    return (
        f"{what} {abs(delay.mean_s):.3f} s {side} {since} "
        f"(SD {delay.sd_s:.3f}, standard error {delay.error_s:.3f}, n = {delay.n})"
    )


def motion_summary(name: str, clip: Clip, corpus: tuple[BodyTrack, ...]) -> dict[str, Any]:
    """Return how a speaker's motion looks, and how it uses postures beside a corpus."""
    looks = looks_of(clip, clip.duration_s)
    use = posture_use(measure_body(clip, name), corpus)
    return {
        "motion": name,
        "seconds": clip.duration_s,
        "still_01": looks.still_01,
        "sliding_cmps": looks.sliding_cmps,
        "jerk_mps3": mean_jerk_mps3(clip, clip.duration_s),
        "posture_bits": use.own_bits,
        "corpus_bits": use.corpus_bits,
        "apart_bits": use.apart_bits,
    }


def motion_table(rows: Sequence[dict[str, Any]]) -> Table:
    """Return summaries of motions as a table."""
    table = Table("motion", box=None, pad_edge=False)
    for heading in ("s", "still", "feet, cm/s", "jerk, m/s³", "postures, bits", "corpus", "apart"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            verbatim(row["motion"]),
            f"{row['seconds']:.1f}",
            f"{row['still_01']:.2f}",
            f"{row['sliding_cmps']:.1f}",
            f"{row['jerk_mps3']:.0f}",
            *(f"{row[name]:.2f}" for name in ("posture_bits", "corpus_bits", "apart_bits")),
        )
    return table


def _room() -> Room:
    floor = level(
        "floor", (-6, -6), (6, 6), 0.0, (176, 174, 170), surfaces.plaster(3), roughness_01=0.9
    )
    sun = replace(DAYLIGHT, casts_shadow=False)
    return Room("sheet", (floor,), (sun,), np.full(3, 0.55), np.full(3, 0.42), (196, 202, 208))


def _picture(
    room: Room, who: Character, clip: Clip, t_s: float, mouth: Mouth | None = None
) -> Picture:
    pose = clip.at(t_s)
    morphs = np.zeros((1, len(MORPHS)))
    if mouth is not None:
        morphs[0, [MORPHS.index("jaw_open"), MORPHS.index("smile")]] = mouth.at(t_s)
    people = PosedPeople(pose.root_m[None], pose.orientation_wxyz[None], morphs)
    return Picture(round(t_s * NS_PER_S), room, (who,), people)


def write_motion_film(
    path: Path,
    who: Character,
    clip: Clip,
    size_px: tuple[int, int],
    report_progress: Callable[[int, int], None],
    speech: Speech | None = None,
) -> None:
    """Draw a motion as a film at the clip's own rate; with `speech`, heard and seen on the lips.

    Raises:
        StageError: the film or its pictures cannot be made here.
    """
    room, camera = _room(), camera_of(FILM_LENS, size_px)
    total = len(clip.root_m) - 1
    mouth = None if speech is None else mouth_of(speech)
    if speech is not None and path.exists():
        raise StageError(f"{path} exists already", remedy="choose another name")
    silent = path if speech is None else path.with_name(f".{path.stem}.silent{path.suffix}")
    draft = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    try:
        with open_movie(silent, size_px, round(1 / clip.frame_s)) as movie, film_drawing() as draw:
            for frame in range(total):
                picture = _picture(room, who, clip, frame * clip.frame_s, mouth)
                movie.add(draw(picture, camera, size_px))
                report_progress(frame + 1, total)
        if speech is not None:
            add_sound(silent, draft, speech.sound)
            draft.rename(path)
    finally:
        if speech is not None:
            silent.unlink(missing_ok=True)
            draft.unlink(missing_ok=True)


def draw_lexemes(path: Path, who: Character, seed: int) -> None:
    """Draw every lexeme at the start, the middle and after the end of its stroke."""
    build = build_of_character(who)
    t_s = np.arange(0.0, 2.0, 1 / 30)
    upright = np.repeat(np.array([[0.0, 0.985, 0.012, 0.0, 0.052, 0.0]]), len(t_s), axis=0)
    rows = -(-len(LEXEMES) // COLUMNS)
    size = (COLUMNS * len(MOMENTS_S) * TILE_PX, rows * (TILE_PX + LABEL_PX))
    sheet = Image.new("RGB", size, (250, 250, 250))
    draw = ImageDraw.Draw(sheet)
    room, camera = _room(), camera_of(SHEET_LENS, (TILE_PX, TILE_PX))
    with Stills() as stills:
        for i, lexeme in enumerate(LEXEMES):
            hand = "both" if lexeme in IN_PAIRS else "R"
            phrase = GesturePhrase(0.2, 0.7, 1.1, 1.4, 1.9, hand, lexeme)
            arms = gesture_arms(GestureScript((phrase,), 2.0), t_s, build.lengths_m, seed)
            clip = performed(build, t_s, upright, np.zeros(len(t_s)), arms, seed)
            left, top = (
                (i % COLUMNS) * len(MOMENTS_S) * TILE_PX,
                (i // COLUMNS) * (TILE_PX + LABEL_PX),
            )
            draw.text((left + 4, top + 4), lexeme, (30, 30, 30), font_for(lexeme, 14))
            for k, moment_s in enumerate(MOMENTS_S):
                tile = stills.image(_picture(room, who, clip, moment_s), camera, (TILE_PX, TILE_PX))
                sheet.paste(Image.fromarray(tile), (left + k * TILE_PX, top + LABEL_PX))
    sheet.save(path)

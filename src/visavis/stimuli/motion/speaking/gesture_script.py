"""Gesture scripts: which gesture a speaker makes when, phrase by phrase, with its phases.

A phrase is a preparation, a stroke (done once or more), a hold and a retraction (Kendon; McNeill).
Scripts are YAML or CSV with the same names, or annotations of ANVIL and ELAN (`annotations`). A
YAML script may name the recording it goes with (`speech: speech.wav`); a phrase with a `word` of it
counts its times from that word's beginning on, and may begin before it (-0.5).
"""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import DataError
from visavis.lab.foreign_text import require_csv
from visavis.lab.plain_files import read_plain
from visavis.lab.yaml_lines import Problem, ProblemsError, did_you_mean, read_document
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.lexemes import LEXEMES
from visavis.stimuli.motion.speaking.speech import Speech, speech_of

NO_HAND: Final = "none"
"""The hand of a phrase in which the body alone moves, as that of somebody who listens."""
HANDS: Final[dict[str, str]] = {"L": "LH", "R": "RH", "both": "2H", NO_HAND: NO_HAND}
"""Hands as scripts write them, and as `phrase_posture.Phrase` does."""
REQUIRED: Final = ("start_s", "stroke_s", "stroke_end_s", "end_s", "hand", "lexeme")
OPTIONAL: Final = ("hold_end_s", "strokes")
TIMES: Final = ("start_s", "stroke_s", "stroke_end_s", "hold_end_s", "end_s")
KEYS: Final = ("phrases", "duration_s", "speech")
MAX_STROKES: Final = 20


@dataclass(frozen=True)
class GesturePhrase:
    """One gesture: preparation from `start_s`, stroke from `stroke_s` to `stroke_end_s` (done
    `strokes` times), hold until `hold_end_s`, retraction until `end_s`. `hand` is L, R or both, or
    none where the body alone moves; then there is no `lexeme`.
    """

    start_s: float
    stroke_s: float
    stroke_end_s: float
    hold_end_s: float
    end_s: float
    hand: str
    lexeme: str
    strokes: int = 1


@dataclass(frozen=True)
class GestureScript:
    """Phrases in the order of time, none over another, within `duration_s`; `speech` is the file of
    the recording they go with.
    """

    phrases: tuple[GesturePhrase, ...]
    duration_s: float
    speech: Path | None = None

    @property
    def mean_phrase_s(self) -> float:
        """Average length of a phrase."""
        return sum(p.end_s - p.start_s for p in self.phrases) / len(self.phrases)


def read_script(path: Path, *, any_lexeme: bool = False) -> GestureScript:
    """Read a script from YAML (.yaml, .yml) or CSV (.csv).

    `any_lexeme` takes lexemes that have no arm movement of ours, as those of a corpus may.

    Raises:
        ConfigError: the file is missing or is not YAML; ProblemsError lists everything that is
            wrong in it, with lines.
        MotionError: it is of another kind or cannot be read.
    """
    kind = path.suffix.lower()
    if kind in (".yaml", ".yml"):
        document = read_document(path)
        problems = list(document.problems)
        data = document.data if isinstance(document.data, Mapping) else {}
        rows = data.get("phrases")
        if not isinstance(rows, list) or not rows:
            raise ProblemsError(
                path, [*problems, Problem(1, "phrases", "missing; list the phrases below it")]
            )
        problems += [
            document.problem([key], f"unknown{did_you_mean(key, KEYS)}")
            for key in sorted(set(data) - set(KEYS))
        ]
        lines = [document.line_of(["phrases", i]) for i in range(len(rows))]
        speech: Speech | None = None
        file = data.get("speech")
        if file is not None:
            try:
                speech = speech_of(path.parent / str(file))
            except DataError as error:
                problems.append(document.problem(["speech"], str(error)))
        rows = _from_words(rows, lines, speech, problems)
        script = script_of_rows(path, rows, lines, problems, data.get("duration_s"), any_lexeme)
        return script if speech is None else replace(script, speech=path.parent / str(file))
    if kind == ".csv":
        try:
            text = read_plain(path).decode("utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise MotionError(f"{path} cannot be read ({error}); save it as UTF-8 text") from error
        require_csv(path, text)
        reader = csv.DictReader(io.StringIO(text))
        rows, lines = [], []
        for row in reader:
            rows.append({k: v for k, v in row.items() if v not in (None, "")})
            lines.append(reader.line_num)
        if not rows:
            raise MotionError(f"{path} has no phrases; give the columns {', '.join(REQUIRED)}")
        return script_of_rows(path, rows, lines, [], None, any_lexeme)
    raise MotionError(f"{path} is no gesture script; give .yaml or .csv, or annotations")


def _from_words(
    rows: Sequence[Any], lines: Sequence[int], speech: Speech | None, problems: list[Problem]
) -> list[Any]:
    """Return rows whose times count from the script's beginning, not from a word's."""
    absolute: list[Any] = []
    for i, (row, line) in enumerate(zip(rows, lines, strict=True), 1):
        if isinstance(row, Mapping) and "word" in row:
            row = dict(row)
            text = str(row.pop("word"))
            start_s = 0.0
            if speech is None:
                text = "has a word, but no recording; name it at the top: speech: FILE.wav"
                problems.append(Problem(line, f"phrase {i}", text))
            else:
                try:
                    start_s = speech.word(text).start_s
                except DataError as error:
                    problems.append(Problem(line, f"phrase {i}", str(error)))
            for name in TIMES:
                number = _number(row.get(name))
                if number is not None:
                    row[name] = round(number + start_s, 6)
        absolute.append(row)
    return absolute


def script_of_rows(
    path: Path,
    rows: Sequence[Any],
    lines: Sequence[int],
    problems: list[Problem],
    duration_s: Any,
    any_lexeme: bool,
) -> GestureScript:
    """Return the script of entries by name; all that is wrong in `path` is raised together.

    Raises:
        ProblemsError: entries are missing, unknown or impossible.
    """
    phrases: list[GesturePhrase] = []
    last_end_s = 0.0
    for i, (row, line) in enumerate(zip(rows, lines, strict=True), 1):
        phrase = _phrase_of(row, Problem(line, f"phrase {i}", ""), problems, any_lexeme)
        if phrase is None:
            continue
        if phrase.start_s < last_end_s:
            text = f"begins at {phrase.start_s:g} s, before the one above ends ({last_end_s:g} s)"
            problems.append(Problem(line, f"phrase {i}", text))
        last_end_s = max(last_end_s, phrase.end_s)
        phrases.append(phrase)
    whole_s = last_end_s if duration_s is None else _number(duration_s)
    if whole_s is None or whole_s < last_end_s:
        text = f"{duration_s!r} is not a time from the last phrase's end ({last_end_s:g} s) on"
        problems.append(Problem(1, "duration_s", text))
    if problems or whole_s is None:
        raise ProblemsError(path, problems)
    return GestureScript(tuple(phrases), whole_s)


def _phrase_of(
    row: Any, at: Problem, problems: list[Problem], any_lexeme: bool
) -> GesturePhrase | None:
    """Return a phrase, or None and what is wrong with it in `problems`."""

    def complain(text: str) -> None:
        problems.append(Problem(at.line, at.key, text))

    count_before = len(problems)
    if not isinstance(row, Mapping):
        complain(f"is {row!r}; give its entries by name: {', '.join(REQUIRED)}")
        return None
    has_gesture = row.get("hand") != NO_HAND
    for name in REQUIRED:
        if not row.get(name) and row.get(name) != 0 and (has_gesture or name != "lexeme"):
            complain(f"{name} is missing")
    for name in row:
        if name not in (*REQUIRED, *OPTIONAL):
            complain(f"{name} is unknown{did_you_mean(name, (*REQUIRED, *OPTIONAL))}")
    if len(problems) > count_before:
        return None
    times: list[float] = []
    for name in TIMES:
        value = row["stroke_end_s"] if row.get(name) is None else row[name]
        number = _number(value)
        if number is None or number < 0:
            complain(f"{name} is {value!r}; give seconds from 0 on")
        else:
            times.append(number)
    if len(times) == len(TIMES):
        for (name, one), (after, other) in zip(
            zip(TIMES, times, strict=True), zip(TIMES[1:], times[1:], strict=True), strict=False
        ):
            # A stroke has a length; preparation, hold and retraction may have none.
            if other < one or (other == one and name == "stroke_s"):
                complain(f"{after} ({other:g} s) comes before {name} ({one:g} s)")
    hand, lexeme = str(row["hand"]), str(row.get("lexeme") or "")
    if hand not in HANDS:
        complain(f"hand is {hand!r}; give L, R, both or none")
    if not has_gesture and lexeme:
        complain(f"lexeme is {lexeme!r}, and hand none: nothing makes it")
    elif has_gesture and lexeme not in LEXEMES and not any_lexeme:
        complain(f"lexeme {lexeme!r} is unknown{did_you_mean(lexeme, LEXEMES)}")
    strokes = _number(row.get("strokes", 1))
    if strokes is None or strokes != int(strokes) or not 1 <= strokes <= MAX_STROKES:
        complain(f"strokes is {row['strokes']!r}; give a whole number from 1 to {MAX_STROKES}")
    if len(problems) > count_before or strokes is None:
        return None
    start_s, stroke_s, stroke_end_s, hold_end_s, end_s = times
    return GesturePhrase(
        start_s, stroke_s, stroke_end_s, hold_end_s, end_s, hand, lexeme, int(strokes)
    )


def _number(value: Any) -> float | None:
    """Return a finite number, or None."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    return number if abs(number) < float("inf") and not isinstance(value, bool) else None


def format_script(script: GestureScript) -> str:
    """Return a script as the text of a YAML file, which `read_script` reads back."""
    lines = [f"duration_s: {script.duration_s:.6g}", "phrases:"]
    for phrase in script.phrases:
        entries = {name: f"{getattr(phrase, name):.6g}" for name in TIMES}
        entries |= {"hand": phrase.hand, "lexeme": phrase.lexeme, "strokes": str(phrase.strokes)}
        lines.append("- {" + ", ".join(f"{k}: {v}" for k, v in entries.items()) + "}")
    return "\n".join(lines) + "\n"

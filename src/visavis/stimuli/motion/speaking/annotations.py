"""Gesture scripts from annotations that were made with ANVIL (XML) or ELAN (EAF).

A phrase tier says lexeme and hand of every gesture, a phase tier its preparation, strokes, holds
and retraction. The files are read by expat, which tells the line of every element, so that what is
missing can be named by it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from visavis.lab.plain_files import read_plain
from visavis.lab.yaml_lines import Problem, ProblemsError, did_you_mean
from visavis.stimuli.motion.errors import MotionError
from visavis.stimuli.motion.speaking.gesture_script import (
    NO_HAND,
    GestureScript,
    read_script,
    script_of_rows,
)

ANNOTATION_SUFFIXES: Final = (".anvil", ".xml", ".eaf")
SCRIPT_SUFFIXES: Final = (".yaml", ".yml", ".csv", *ANNOTATION_SUFFIXES)
HAND_WORDS: Final[dict[str, str]] = {
    "l": "L", "lh": "L", "left": "L", "left hand": "L",
    "r": "R", "rh": "R", "right": "R", "right hand": "R",
    "b": "both", "2h": "both", "both": "both", "both hands": "both", "bh": "both",
    "none": NO_HAND, "no hand": NO_HAND,
}  # fmt: skip
PHASES: Final = {"stroke": "stroke", "hold": "hold", "prep": "prep", "retr": "retract"}
"""Beginnings of the names of phases; others (recoil, beat, partial retraction) are left out."""
MAX_DEPTH: Final = 40


@dataclass(frozen=True)
class Tiers:
    """Names of the tiers or tracks and of the attributes that say what a gesture is. A track of
    ANVIL is also found by the last part of its name (`gesture.phase`).
    """

    phrase: str = "phrase"
    phase: str = "phase"
    hand: str = "hand"
    lexeme: str = "lexeme"


@dataclass
class _Element:
    """An element of an XML file with the line it begins in."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    text: str = ""
    children: list["_Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["_Element"]:
        """Return all elements of a tag below this one, in the order of the file."""
        below = []
        for child in self.children:
            below += [child] if child.tag == tag else []
            below += child.all(tag)
        return below


@dataclass(frozen=True)
class _Span:
    start_s: float
    end_s: float
    line: int
    values: Mapping[str, str]


def read_any_script(
    path: Path, tiers: Tiers | None = None, *, any_lexeme: bool = False
) -> GestureScript:
    """Read a gesture script of any kind: YAML, CSV, or annotations of ANVIL or ELAN.

    Raises:
        ConfigError: the file is missing; ProblemsError lists everything that is wrong in it.
        MotionError: it is of another kind or cannot be read.
    """
    if path.suffix.lower() not in ANNOTATION_SUFFIXES:
        return read_script(path, any_lexeme=any_lexeme)
    return read_annotations(path, tiers or Tiers(), any_lexeme=any_lexeme)


def read_annotations(path: Path, tiers: Tiers, *, any_lexeme: bool = False) -> GestureScript:
    """Read the gestures of an annotation of ANVIL or ELAN.

    Raises:
        ProblemsError: tiers, clips or times are missing or impossible; all of them, with lines.
        MotionError: the file is missing, is no XML, or of neither program.
    """
    root = _parsed(path)
    problems: list[Problem] = []
    if root.tag == "ANNOTATION_DOCUMENT":
        phrases, phases = _elan(path, root, tiers, problems)
    elif root.tag == "annotation":
        phrases, phases = _anvil(path, root, tiers, problems)
    else:
        raise MotionError(
            f"{path} is an XML file with <{root.tag}>; give an annotation of ANVIL (<annotation>) "
            "or ELAN (<ANNOTATION_DOCUMENT>)"
        )
    if not phrases and not problems:
        problems.append(Problem(root.line, tiers.phrase, "no phrase is annotated"))
    rows, lines = [], []
    for i, phrase in enumerate(phrases, 1):
        row = _row_of(phrase, phases, tiers, Problem(phrase.line, f"phrase {i}", ""), problems)
        if row is not None:
            rows.append(row)
            lines.append(phrase.line)
    if problems:
        raise ProblemsError(path, problems)
    return script_of_rows(path, rows, lines, problems, None, any_lexeme)


def _row_of(
    phrase: _Span, phases: Sequence[_Span], tiers: Tiers, at: Problem, problems: list[Problem]
) -> dict[str, Any] | None:
    """Return the entries of a phrase; None where its stroke, hand or lexeme is missing."""

    def complain(text: str) -> None:
        problems.append(Problem(at.line, at.key, text))

    count_before = len(problems)
    own = [p for p in phases if phrase.start_s <= (p.start_s + p.end_s) / 2 <= phrase.end_s]
    strokes = [p for p in own if p.values["phase"] == "stroke"]
    if not strokes:
        complain(f"no stroke on tier {tiers.phase!r} from {phrase.start_s:g} to {phrase.end_s:g} s")
    word = phrase.values.get(tiers.hand) or phrase.values.get("handedness") or ""
    hand = HAND_WORDS.get(word.strip().lower())
    if hand is None:
        what = f"is {word!r}; give LH, RH, 2H or none" if word else "is missing"
        complain(f"{tiers.hand} {what}")
    lexeme = "_".join((phrase.values.get(tiers.lexeme) or "").lower().split())
    if not lexeme and hand != NO_HAND:
        complain(f"{tiers.lexeme} is missing")
    if len(problems) > count_before:
        return None
    end_s = strokes[-1].end_s
    hold_end_s = end_s
    for phase in own:
        if phase.values["phase"] == "hold" and phase.start_s >= end_s - 1e-6:
            hold_end_s = phase.end_s
    return {
        "start_s": phrase.start_s,
        "stroke_s": strokes[0].start_s,
        "stroke_end_s": end_s,
        "hold_end_s": min(hold_end_s, phrase.end_s),
        "end_s": phrase.end_s,
        "hand": hand,
        "lexeme": lexeme,
        "strokes": len(strokes),
    }


def _phase_of(word: str) -> str:
    word = word.strip().lower()
    return next((phase for start, phase in PHASES.items() if word.startswith(start)), word)


def _anvil(
    path: Path, root: _Element, tiers: Tiers, problems: list[Problem]
) -> tuple[list[_Span], list[_Span]]:
    """Return phrases and phases of an annotation of ANVIL."""
    tracks = {track.attributes.get("name", ""): track for track in root.all("track")}

    def track_named(name: str) -> _Element:
        for full, track in tracks.items():
            if name == full or full.rsplit(".", 1)[-1] == name:
                return track
        raise ProblemsError(
            path, [Problem(root.line, name, f"there is no such track{did_you_mean(name, tracks)}")]
        )

    def values_of(element: _Element) -> dict[str, str]:
        return {a.attributes.get("name", ""): a.text.strip() for a in element.all("attribute")}

    def spans(track: _Element, above: tuple[str, ...] = ()) -> list[_Span]:
        name = track.attributes.get("name", "")
        reference = track.attributes.get("ref")
        if name in above:
            raise ProblemsError(path, [Problem(track.line, name, "refers to itself")])
        parts: list[_Span] | None = None
        if reference is not None and track.attributes.get("type") != "primary":
            parts = spans(track_named(reference), (*above, name))
        result = []
        for element in track.all("el"):
            span = _anvil_span(element, parts, values_of(element), name, problems)
            if span is not None:
                result.append(span)
        return result

    phases = [
        _Span(s.start_s, s.end_s, s.line, {"phase": _phase_of(s.values.get("type", ""))})
        for s in spans(track_named(tiers.phase))
    ]
    return spans(track_named(tiers.phrase)), phases


def _anvil_span(
    element: _Element,
    parts: Sequence[_Span] | None,
    values: Mapping[str, str],
    track: str,
    problems: list[Problem],
) -> _Span | None:
    """Return an element's span: in seconds, or from one element of another track to one."""
    ends: list[float] = []
    for name, of_part in (("start", "start_s"), ("end", "end_s")):
        text = element.attributes.get(name, "")
        try:
            number = float(text)
            if parts is not None:
                row = int(text)
                if not 0 <= row < len(parts):
                    raise IndexError
                number = float(getattr(parts[row], of_part))
        except (ValueError, IndexError):
            what = (
                "a time in seconds" if parts is None else f"an element from 0 to {len(parts) - 1}"
            )
            problems.append(Problem(element.line, track, f"{name} is {text!r}, not {what}"))
            return None
        ends.append(number)
    return _Span(ends[0], ends[1], element.line, values)


def _elan(
    path: Path, root: _Element, tiers: Tiers, problems: list[Problem]
) -> tuple[list[_Span], list[_Span]]:
    """Return phrases and phases of an annotation of ELAN.

    The phrase tier's texts are the lexemes, unless there is a tier of that name; the hand's tier
    (and the lexeme's) says it of the phrase it refers to, or lies over in time.
    """
    slots = {
        slot.attributes.get("TIME_SLOT_ID", ""): slot.attributes.get("TIME_VALUE")
        for slot in root.all("TIME_SLOT")
    }
    by_name = {tier.attributes.get("TIER_ID", ""): tier for tier in root.all("TIER")}

    def tier_named(name: str) -> _Element:
        if name not in by_name:
            raise ProblemsError(
                path,
                [Problem(root.line, name, f"there is no such tier{did_you_mean(name, by_name)}")],
            )
        return by_name[name]

    def text_of(element: _Element) -> str:
        return "".join(v.text for v in element.all("ANNOTATION_VALUE")).strip()

    def spans(name: str) -> list[tuple[str, _Span]]:
        result = []
        for element in tier_named(name).all("ALIGNABLE_ANNOTATION"):
            times = []
            for end in ("TIME_SLOT_REF1", "TIME_SLOT_REF2"):
                value = slots.get(element.attributes.get(end, ""))
                if value is None or not value.isdecimal():
                    problems.append(
                        Problem(element.line, name, f"{end} has no time; align it in ELAN")
                    )
                    break
                times.append(float(value) / 1000)
            if len(times) == 2:
                span = _Span(times[0], times[1], element.line, {"text": text_of(element)})
                result.append((element.attributes.get("ANNOTATION_ID", ""), span))
        return result

    phases = [
        _Span(s.start_s, s.end_s, s.line, {"phase": _phase_of(s.values["text"])})
        for _, s in spans(tiers.phase)
    ]
    attributes: dict[str, dict[str, str]] = {}
    over: dict[str, list[_Span]] = {}
    for name in (tiers.hand, tiers.lexeme):
        if name == tiers.lexeme and name not in by_name:
            continue
        for element in tier_named(name).all("REF_ANNOTATION"):
            above = element.attributes.get("ANNOTATION_REF", "")
            attributes.setdefault(above, {})[name] = text_of(element)
        over[name] = [span for _, span in spans(name)]
    phrases = []
    for key, span in spans(tiers.phrase):
        values = {tiers.lexeme: span.values["text"]}
        for name, others in over.items():
            middle = (span.start_s + span.end_s) / 2
            said_here = [o.values["text"] for o in others if o.start_s <= middle <= o.end_s]
            if said_here:
                values[name] = said_here[-1]
        values |= attributes.get(key, {})
        phrases.append(_Span(span.start_s, span.end_s, span.line, values))
    return sorted(phrases, key=lambda s: s.start_s), sorted(phases, key=lambda s: s.start_s)


def _parsed(path: Path) -> _Element:
    """Return the root of an XML file.

    Raises:
        MotionError: it is missing, no XML, nested too deeply, or declares entities.
    """
    try:
        data = read_plain(path)
    except OSError as error:
        raise MotionError(f"{path} cannot be read ({error.strerror or error})") from error
    parser = expat.ParserCreate()
    parser.buffer_text = True
    above: list[tuple[_Element, list[str]]] = []
    roots: list[_Element] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = _Element(tag, attributes, parser.CurrentLineNumber)
        if len(above) >= MAX_DEPTH:
            raise MotionError(f"{path} line {element.line}: nested deeper than {MAX_DEPTH} levels")
        (above[-1][0].children if above else roots).append(element)
        above.append((element, []))

    def end(_: str) -> None:
        element, pieces = above.pop()
        element.text = "".join(pieces)

    def text(piece: str) -> None:
        above[-1][1].append(piece)

    def refuse(*_: object) -> None:
        raise MotionError(
            f"{path} line {parser.CurrentLineNumber}: it declares entities or attributes; remove "
            "its DOCTYPE"
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = parser.AttlistDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        line = getattr(error, "lineno", parser.CurrentLineNumber)
        raise MotionError(
            f"{path} line {line}: it is not complete XML ({error}); save or export it again"
        ) from error
    return roots[0]

"""Questionnaires as data: items, scales, scores, read from YAML and checked in full.

A questionnaire yields questions in order and turns answers into scores; who asks, and where,
is not its concern.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

from visavis.lab.errors import ConfigError, UsageError
from visavis.lab.model_problems import model_problems
from visavis.lab.units import read_quantity
from visavis.lab.yaml_lines import Document, Problem, ProblemsError, did_you_mean, read_document

SCALES_DIR = Path(__file__).parent / "scales"
_NAME = re.compile(r"[a-z][a-z0-9_]*")

Answer: TypeAlias = str | int | float


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Scale(_Part):
    """How a question is answered: one of `options` (value: label), a number, or free text."""

    kind: Literal["options", "number", "text"] = "options"
    prompt: str = ""
    options: dict[int, str] = Field(default_factory=dict)
    minimum: float | None = None
    maximum: float | None = None


class Item(_Part):
    """A statement or situation, asked once for each of its scales."""

    id: str
    text: str = Field(min_length=1)
    scales: list[str] = Field(min_length=1)
    tags: list[str] = Field(default_factory=list)
    reverse: bool = False
    required: bool = True


class Score(_Part):
    """A score over the questions that have one of `scales`, `tags` and `items` (empty: all).

    With at most `missing_allowed` answers missing, a mean is over the others and a sum is their
    mean times the number of questions; with more, the score is missing. With `each_tag` a question
    counts once for each of the `tags` that it has; `factor` multiplies the result.
    """

    method: Literal["sum", "mean"] = "sum"
    scales: list[str] = Field(default_factory=list)
    tags: list[str] = Field(default_factory=list)
    items: list[str] = Field(default_factory=list)
    missing_allowed: int = Field(default=0, ge=0)
    each_tag: bool = False
    factor: float = Field(default=1.0, gt=0)


@dataclass(frozen=True)
class Question:
    """One question as asked; `options` are the labels in order, empty for numbers and text.

    `question_id` is the item's id, with ".scale" when the item has several scales.
    """

    question_id: str
    item: Item
    scale_name: str
    scale: Scale
    prompt: str
    options: tuple[str, ...]


class Questionnaire(_Part):
    """A whole questionnaire; `licence` says on what terms its wording may be used.

    `reworded` names the scale whose structure it has in other words than its authors'.
    """

    name: str
    title: str = Field(min_length=1)
    version: int = Field(ge=1)
    language: str = "en"
    citation: str = ""
    licence: str = Field(min_length=1)
    reworded: str = ""
    instruction: str = ""
    scales: dict[str, Scale] = Field(min_length=1)
    items: list[Item] = Field(min_length=1)
    scores: dict[str, Score] = Field(default_factory=dict)
    wording: str = Field(default="", exclude=True)
    """Name of the file whose texts replace its own; empty when none does."""

    @property
    def caveat(self) -> str:
        """The sentence that goes wherever a score is named; empty for a scale in its own words."""
        if not self.reworded:
            return ""
        return (
            f"{self.title}: reworded, not validated. Its items are not in the words of "
            f"{self.reworded}; norms, cut-offs and printed values of that scale do not apply to it."
        )

    def questions(self) -> Iterator[Question]:
        """Yield every question in the order of asking."""
        for item in self.items:
            for name in item.scales:
                scale = self.scales[name]
                yield Question(
                    question_id=item.id if len(item.scales) == 1 else f"{item.id}.{name}",
                    item=item,
                    scale_name=name,
                    scale=scale,
                    prompt=f"{item.text} {scale.prompt}".strip(),
                    options=tuple(scale.options.values()),
                )


class _ScaleWording(_Part):
    prompt: str | None = None
    options: dict[int, str] = Field(default_factory=dict)


class _Wording(_Part):
    questionnaire: str
    language: str = Field(min_length=1)
    title: str | None = None
    licence: str | None = None
    citation: str | None = None
    instruction: str | None = None
    scales: dict[str, _ScaleWording] = Field(default_factory=dict)
    items: dict[str, str] = Field(default_factory=dict)


def available() -> tuple[str, ...]:
    """Return the names of the questionnaires that come with Visavis."""
    return tuple(sorted(p.stem for p in SCALES_DIR.glob("*.yaml") if "." not in p.stem))


def load_questionnaire(
    source: str | Path, wording: Path | None = None, *, language: str = ""
) -> Questionnaire:
    """Read a questionnaire: a name that comes with Visavis, or a file.

    For a `language` other than its own, texts come from the file NAME.LANGUAGE.yaml next to it,
    where there is one; the `language` of the result says which was used. `wording` is a lab's file
    that replaces texts (a translation, a licensed wording) and leaves structure and scoring alone;
    one that states its `licence` and words every item has the scale's own words.

    Raises:
        ConfigError: every problem with its line.
    """
    if isinstance(source, str):
        if source not in available():
            hint = did_you_mean(source, available())
            raise ConfigError(f"there is no questionnaire {source!r}{hint}")
        source = SCALES_DIR / f"{source}.yaml"
    document = read_document(source)
    raw = _mapping(document)
    if "questionnaire" in raw:
        raise ConfigError(
            f"{source} is in the form of a wording (questionnaire: {raw['questionnaire']}), which "
            "replaces texts of a questionnaire that is there; name it under wording: in "
            "lab_config.yaml, or write a questionnaire as docs/questionnaires.md shows"
        )
    problems = [*document.problems, *model_problems(document, Questionnaire, raw, ())]
    if not problems:
        problems = _inconsistencies(document, Questionnaire.model_validate(raw))
    if problems:
        raise ProblemsError(document.path, problems)
    questionnaire = Questionnaire.model_validate(raw)
    translation_path = source.with_suffix(f".{language}.yaml")
    if language and language != questionnaire.language and translation_path.is_file():
        questionnaire = _with_wording(questionnaire, translation_path)
    return questionnaire if wording is None else _with_wording(questionnaire, wording)


def read_answer(question: Question, answer: Answer | None) -> Answer | None:
    """Return the value of an answer as given: a label, a value, a number or text.

    None and blank mean left out. Raises UsageError, with what is possible, for anything else.
    """
    text = "" if answer is None else str(answer).strip()
    if not text:
        return None
    scale = question.scale
    if scale.kind == "text":
        return text
    if scale.kind == "options":
        for value, label in scale.options.items():
            if text.casefold() == label.casefold():
                return value
        for value in scale.options:
            if text == str(value):
                return value
        choices = ", ".join(f"{value} {label}" for value, label in scale.options.items())
        raise UsageError(
            f"{question.question_id}: {text!r} is not an answer; choose from {choices}"
        )
    quantity = read_quantity(text)
    if quantity is None or quantity[1] is not None:
        raise UsageError(f"{question.question_id}: {text!r} is not a number; type digits only")
    number = quantity[0]
    low, high = scale.minimum, scale.maximum
    if (low is not None and number < low) or (high is not None and number > high):
        bounds = " and ".join(
            part
            for part in (
                f"at least {low:g}" if low is not None else "",
                f"at most {high:g}" if high is not None else "",
            )
            if part
        )
        raise UsageError(f"{question.question_id}: {text} is not possible; it must be {bounds}")
    return int(number) if number.is_integer() else number


def read_answers(
    questionnaire: Questionnaire, answers: Mapping[str, Answer | None]
) -> dict[str, Answer | None]:
    """Return the value of every question, None where it was not answered.

    Raises UsageError for answers to unknown questions or outside the scale.
    """
    questions = {q.question_id: q for q in questionnaire.questions()}
    for question_id in answers:
        if question_id not in questions:
            hint = did_you_mean(question_id, questions)
            raise UsageError(f"{questionnaire.name} has no question {question_id!r}{hint}")
    return {name: read_answer(q, answers.get(name)) for name, q in questions.items()}


def unanswered_questions(
    questionnaire: Questionnaire, answers: Mapping[str, Answer | None]
) -> tuple[str, ...]:
    """Return the required questions without an answer, in order."""
    values = read_answers(questionnaire, answers)
    return tuple(
        q.question_id
        for q in questionnaire.questions()
        if q.item.required and values[q.question_id] is None
    )


def score(
    questionnaire: Questionnaire, answers: Mapping[str, Answer | None]
) -> dict[str, float | None]:
    """Return every score by name; None where too many answers are missing."""
    values = read_answers(questionnaire, answers)
    scores: dict[str, float | None] = {}
    for name, rule in questionnaire.scores.items():
        questions = _questions_of(questionnaire, rule)
        item_values = [
            _apply_key(q, float(value))
            for q in questions
            if (value := values[q.question_id]) is not None and not isinstance(value, str)
        ]
        if not item_values or len(questions) - len(item_values) > rule.missing_allowed:
            scores[name] = None
        elif rule.method == "mean":
            scores[name] = rule.factor * sum(item_values) / len(item_values)
        else:
            scores[name] = rule.factor * sum(item_values) * len(questions) / len(item_values)
    return scores


def score_range(questionnaire: Questionnaire, name: str) -> tuple[float, float]:
    """Return the least and the greatest value a score can take."""
    rule = questionnaire.scores[name]
    bounds = [_bounds(q.scale) for q in _questions_of(questionnaire, rule)]
    per = rule.factor if rule.method == "sum" else rule.factor / len(bounds)
    return per * sum(low for low, _ in bounds), per * sum(high for _, high in bounds)


def _questions_of(questionnaire: Questionnaire, rule: Score) -> list[Question]:
    """Return the questions of a score, one several times where it counts for several tags."""
    return [
        q
        for q in questionnaire.questions()
        for _ in range(len(set(rule.tags) & set(q.item.tags)) if rule.each_tag else 1)
        if q.scale.kind != "text"
        and (not rule.scales or q.scale_name in rule.scales)
        and (not rule.tags or set(rule.tags) & set(q.item.tags))
        and (not rule.items or q.item.id in rule.items)
    ]


def _apply_key(question: Question, value: float) -> float:
    """Turn a reverse-keyed answer round within its scale."""
    if not question.item.reverse:
        return value
    low, high = _bounds(question.scale)
    return low + high - value


def _bounds(scale: Scale) -> tuple[float, float]:
    if scale.kind == "options":
        return float(min(scale.options)), float(max(scale.options))
    infinity = float("inf")
    low = -infinity if scale.minimum is None else scale.minimum
    return low, infinity if scale.maximum is None else scale.maximum


# ---- checking ------------------------------------------------------------------------------


def _mapping(document: Document) -> dict[str, Any]:
    if not isinstance(document.data, dict):
        at_top = document.problem((), "expects settings such as `name: NAME`")
        raise ProblemsError(document.path, [*document.problems, at_top])
    return {str(key): value for key, value in document.data.items()}


def _inconsistencies(document: Document, q: Questionnaire) -> list[Problem]:
    problems: list[Problem] = []

    def complain(place: Sequence[str | int], message: str) -> None:
        problems.append(document.problem(place, message))

    for name, scale in q.scales.items():
        for message in _scale_faults(scale):
            complain(("scales", name), message)
    for name in (*q.scales, *q.scores):
        if not _NAME.fullmatch(name):
            section = "scales" if name in q.scales else "scores"
            complain((section, name), "write names in small letters, digits and underscores")
    first_of: dict[str, int] = {}
    for i, item in enumerate(q.items):
        if not _NAME.fullmatch(item.id):
            complain(("items", i, "id"), "write ids in small letters, digits and underscores")
        if item.id in first_of:
            first = document.line_of(("items", first_of[item.id], "id"))
            complain(("items", i, "id"), f"{item.id!r} is given twice, first on line {first}")
        first_of.setdefault(item.id, i)
        for name in item.scales:
            if name not in q.scales:
                complain(("items", i, "scales"), f"no scale {name!r}{did_you_mean(name, q.scales)}")
            elif item.reverse and q.scales[name].kind != "options":
                complain(("items", i, "reverse"), f"scale {name!r} has no options to turn round")
        if len(set(item.scales)) < len(item.scales):
            complain(("items", i, "scales"), "a scale is given twice")
    if not problems:
        problems += _score_faults(document, q)
    return problems


def _scale_faults(scale: Scale) -> list[str]:
    faults = []
    if scale.kind == "options" and len(scale.options) < 2:
        faults.append("needs at least two options (value: label), or kind: number or text")
    if scale.kind != "options" and scale.options:
        faults.append(f"a scale of kind {scale.kind} has no options")
    if scale.kind != "number" and (scale.minimum is not None or scale.maximum is not None):
        faults.append("minimum and maximum belong to scales of kind number")
    if scale.minimum is not None and scale.maximum is not None and scale.minimum >= scale.maximum:
        faults.append("minimum must be less than maximum")
    labels = [label.strip().casefold() for label in scale.options.values()]
    if len(set(labels)) < len(labels) or "" in labels:
        faults.append("labels must differ from each other and not be empty")
    return faults


def _score_faults(document: Document, q: Questionnaire) -> list[Problem]:
    problems = []
    names_by_section = {
        "scales": set(q.scales),
        "tags": {tag for item in q.items for tag in item.tags},
        "items": {item.id for item in q.items},
    }
    for name, rule in q.scores.items():
        for section, names in names_by_section.items():
            problems += [
                document.problem(
                    ("scores", name, section),
                    f"no {section[:-1]} {entry!r}{did_you_mean(entry, names)}",
                )
                for entry in getattr(rule, section)
                if entry not in names
            ]
        if not _questions_of(q, rule):
            problems.append(document.problem(("scores", name), "no question belongs to this score"))
    return problems


def _with_wording(questionnaire: Questionnaire, path: Path) -> Questionnaire:
    document = read_document(path)
    raw = _mapping(document)
    problems = [*document.problems, *model_problems(document, _Wording, raw, ())]
    if problems:
        raise ProblemsError(path, problems)
    wording = _Wording.model_validate(raw)
    if wording.questionnaire != questionnaire.name:
        message = f"is {wording.questionnaire!r}, but the texts are wanted for {questionnaire.name}"
        problems.append(document.problem(("questionnaire",), message))
    items = {item.id: item for item in questionnaire.items}
    problems += [
        document.problem(("items", name), f"no item{did_you_mean(name, items)}")
        for name in wording.items
        if name not in items
    ]
    scales = dict(questionnaire.scales)
    for name, texts in wording.scales.items():
        if name not in scales:
            hint = did_you_mean(name, scales)
            problems.append(document.problem(("scales", name), f"no scale{hint}"))
            continue
        old = scales[name]
        for value in texts.options.keys() - old.options.keys():
            place = ("scales", name, "options", str(value))
            possible = ", ".join(map(str, old.options))
            problems.append(document.problem(place, f"no option {value}; known: {possible}"))
        prompt = old.prompt if texts.prompt is None else texts.prompt
        labels = {value: texts.options.get(value, label) for value, label in old.options.items()}
        scales[name] = old.model_copy(update={"prompt": prompt, "options": labels})
        problems += [
            document.problem(("scales", name), fault) for fault in _scale_faults(scales[name])
        ]
    if problems:
        raise ProblemsError(path, problems)
    plain = {
        key: value
        for key in ("title", "licence", "citation", "instruction", "language")
        if (value := getattr(wording, key)) is not None
    }
    new_items = [
        item.model_copy(update={"text": wording.items.get(item.id, item.text)})
        for item in questionnaire.items
    ]
    has_own_words = wording.licence is not None and items.keys() <= wording.items.keys()
    return questionnaire.model_copy(
        update={
            **plain,
            "scales": scales,
            "items": new_items,
            "wording": path.name,
            "reworded": "" if has_own_words else questionnaire.reworded,
        }
    )

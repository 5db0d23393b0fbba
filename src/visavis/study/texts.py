"""Everything a participant reads, by language, with placeholders filled from parameters.

A folder of `en.yaml`, `de.yaml` … holds nested texts; `questions.realism` is the text at `realism`
below `questions`. The kit's own words (buttons of boards, names of blocks) lie in
`src/visavis/study/words`; a study's file may replace any of them.
"""

import string
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import ConfigError
from visavis.lab.yaml_lines import did_you_mean, read_document

WORDS_DIR: Final = Path(__file__).parent / "words"
DEFAULT_LANGUAGE: Final = "en"
NOT_READ_BY_PARTICIPANTS: Final = "labels."
"""Labels of factors and levels in figures; without a text their names are used."""


@dataclass(frozen=True)
class Texts:
    """The texts of one study in one language: `entries` by dotted name; `source` names the file."""

    language: str
    entries: Mapping[str, str] = field(repr=False)
    own: frozenset[str] = frozenset()
    source: str = ""

    def get(self, name: str, values: Mapping[str, Any] | None = None) -> str:
        """Return a text with its placeholders filled.

        Raises:
            ConfigError: there is no such text, or a placeholder has no value.
        """
        if name not in self.entries:
            raise ConfigError(
                f"{self.source or 'the texts'} ({self.language}) has no text {name!r}"
                f"{did_you_mean(name, tuple(self.entries))}"
            )
        text = self.entries[name]
        fillers = dict(values or {})
        for placeholder in placeholders_of(text):
            if placeholder not in fillers:
                fillers |= self._in_words(placeholder, fillers)
            if placeholder not in fillers:
                hint = did_you_mean(placeholder, tuple(fillers))
                raise ConfigError(
                    f"{self.source} ({self.language}), {name}: nothing fills {{{placeholder}}}"
                    f"{hint}; it can name {', '.join(sorted(fillers)) or 'nothing'}"
                )
        return text.format_map({k: format_value(v) for k, v in fillers.items()})

    def _in_words(self, placeholder: str, values: Mapping[str, Any]) -> dict[str, str]:
        """Return {trials_in_words} and {part_ordinal}: words up to twelve, digits beyond."""
        for ending, words in (("_in_words", "numbers"), ("_ordinal", "ordinals")):
            name = placeholder.removesuffix(ending)
            if name != placeholder and name in values:
                return {
                    placeholder: self.find(f"{words}.{format_value(values[name])}")
                    or format_value(values[name])
                }
        return {}

    def find(self, *names: str, values: Mapping[str, Any] | None = None) -> str | None:
        """Return the first of several texts that exists, None if none does."""
        for name in names:
            if name in self.entries:
                return self.get(name, values)
        return None

    def below(self, prefix: str) -> Iterator[str]:
        """Yield the names of the texts below a prefix."""
        for name in self.entries:
            if name.startswith(prefix + "."):
                yield name.removeprefix(prefix + ".")


def format_value(value: Any) -> str:
    """Write a value as a participant reads it: 4, not 4.0."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def placeholders_of(text: str) -> tuple[str, ...]:
    """Return the names in braces of a text."""
    return tuple(name for _, name, _, _ in string.Formatter().parse(text) if name)


def languages_in(folder: Path) -> tuple[str, ...]:
    """Return the languages a folder of texts has."""
    return tuple(sorted(path.stem for path in folder.glob("*.yaml")))


def read_texts(folders: Sequence[Path], language: str = DEFAULT_LANGUAGE) -> Texts:
    """Read the kit's words and a study's texts in one language; later folders replace earlier.

    Raises:
        ConfigError: the study has no such language, its file lacks what another language's file
            has, or it cannot be read.
    """
    words_language = language if language in languages_in(WORDS_DIR) else DEFAULT_LANGUAGE
    entries = dict(_words(words_language))
    own: dict[str, str] = {}
    source = "Visavis"
    for folder in folders:
        if not folder.is_dir():
            raise ConfigError(
                f"there is no folder {folder} for the study's texts; make it, or say texts=None"
            )
        if language not in languages_in(folder):
            has = ", ".join(languages_in(folder)) or "none"
            raise ConfigError(
                f"{folder} has no {language}.yaml; it has {has}. Choose one of them with "
                "--language, or translate the file"
            )
        source = str(folder / f"{language}.yaml")
        own |= dict(_read(folder / f"{language}.yaml"))
    _require_all(folders, language, entries | own, source)
    return Texts(language, entries | own, frozenset(own), source)


def _require_all(
    folders: Sequence[Path], language: str, there: Mapping[str, str], source: str
) -> None:
    """Refuse texts of a language that lack a text which participants read in another language.

    Raises:
        ConfigError: naming the texts, and the file that has them.
    """
    for folder in folders:
        for other in languages_in(folder):
            file = folder / f"{other}.yaml"
            try:
                names = _names_in(file, file.stat().st_mtime_ns)
            except ConfigError:
                continue  # reported when that language is used
            lacking = [
                n for n in names if n not in there and not n.startswith(NOT_READ_BY_PARTICIPANTS)
            ]
            if lacking:
                lacking_text = ", ".join(map(repr, lacking))
                raise ConfigError(
                    f"{source} has no text {lacking_text}, which {file} has; "
                    "translate it, or take it out of both"
                )


def own_texts(path: Path) -> dict[str, str]:
    """Return the texts of one file by dotted name, without a check against other languages.

    Raises:
        ConfigError: it cannot be read.
    """
    return dict(_read(path))


@cache
def _names_in(path: Path, changed_ns: int) -> tuple[str, ...]:
    """Return the names of a file's texts; the file is read again only after a change."""
    return tuple(name for name, _ in _read(path))


@cache
def _words(language: str) -> tuple[tuple[str, str], ...]:
    return _read(WORDS_DIR / f"{language}.yaml")


def _read(path: Path) -> tuple[tuple[str, str], ...]:
    document = read_document(path)
    if document.problems:
        raise ConfigError(f"{path}: {'; '.join(str(p) for p in document.problems)}")
    raw = document.data
    if not isinstance(raw, Mapping):
        raise ConfigError(f"{path} has no texts; write NAME: TEXT on each line")
    return tuple(_flat(raw, path))


def _flat(raw: Mapping[Any, Any], path: Path, prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in raw.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            yield from _flat(value, path, f"{name}.")
        elif isinstance(value, str | int | float) and not isinstance(value, bool):
            yield name, str(value).strip()
        else:
            raise ConfigError(f"{path}: {name} is {value!r}; write a text")


UNITS: Final = {"m": "m", "cm": "cm", "s": "s", "ms": "ms", "deg": "°", "hz": "Hz", "cd": "cd"}
"""Units at the end of a name, and how they are written."""


def label_in_unit(texts: Texts, name: str) -> str:
    """Return a factor's label with the unit at the end of its name: "distance in m"."""
    of, _, unit = name.rpartition("_")
    own = texts.find(f"labels.{name}")
    return (
        f"{label_of(texts, of)} in {UNITS[unit]}"
        if not own and of and unit in UNITS
        else (own or label_of(texts, name))
    )


def label_of(texts: Texts, name: str) -> str:
    """Return the label of a factor or a level in figures and tables."""
    return texts.find(f"labels.{name}") or name.replace("_", " ")

"""Read YAML so that every error message can name the line."""

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from visavis.lab.errors import ConfigError
from visavis.lab.plain_files import read_plain

MAX_BYTES = 16 * 1024 * 1024
MAX_DEPTH = 50
MAX_KEYS = 200_000

KeyPath: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True, order=True)
class Problem:
    """One thing wrong in a file; `line` counts from 1, `key` is dotted ("devices.headset")."""

    line: int
    key: str
    message: str


class ProblemsError(ConfigError):
    """Everything wrong with one file, one line each; `problems` for machines."""

    def __init__(self, path: Path, problems: Iterable[Problem]) -> None:
        self.path = path
        self.problems = tuple(sorted(set(problems)))
        lines = [
            f"{path}:{p.line}: {p.key}: {p.message}" if p.key else f"{path}:{p.line}: {p.message}"
            for p in self.problems
        ]
        count = len(lines)
        head = f"{path} has {count} problem{'s' if count != 1 else ''}; correct and try again:"
        super().__init__("\n  ".join([head, *lines]))


@dataclass(frozen=True)
class Document:
    """A YAML file as plain data, with the line of every key.

    `problems` holds duplicate keys, which YAML would silently resolve to the last.
    """

    path: Path
    text: str
    data: Any
    lines: dict[KeyPath, int]
    problems: tuple[Problem, ...]

    def line_of(self, key_path: Sequence[str | int]) -> int:
        """Return the line of a key, or of its nearest ancestor that is in the file."""
        path = tuple(key_path)
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def problem(self, key_path: Sequence[str | int], message: str) -> Problem:
        """Return a problem at a key."""
        return Problem(self.line_of(key_path), key_text(key_path), message)


def key_text(key_path: Sequence[str | int]) -> str:
    """Return a key path as text: `items[3].text`."""
    text = ""
    for part in key_path:
        if isinstance(part, int):
            text += f"[{part + 1}]"
        else:
            text += f".{part}" if text else part
    return text


def did_you_mean(word: object, choices: Iterable[str]) -> str:
    """Return "; did you mean 'x'?" or, when nothing is near, "; known: ..."."""
    names = sorted(choices)
    near = difflib.get_close_matches(str(word), names, n=1, cutoff=0.6)
    if near:
        return f"; did you mean {near[0]!r}?"
    return f"; known: {', '.join(names)}" if names else ""


def names_or_none(names: Iterable[object]) -> str:
    """Return names for the end of a message that says what there is; "none" without any."""
    return ", ".join(map(str, names)) or "none"


def read_document(path: Path) -> Document:
    """Read a YAML file. Raises ConfigError when it cannot be read or is not YAML."""
    try:
        text = read_plain(path, max_bytes=MAX_BYTES).decode("utf-8-sig")
    except FileNotFoundError:
        raise ConfigError(f"{path} is not there; give the path of an existing file") from None
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ProblemsError(
            path, [Problem(line, "", "not UTF-8; save the file as UTF-8")]
        ) from None
    return parse_document(text, path)


def parse_document(text: str, path: Path) -> Document:
    """Parse YAML text; `path` is what messages name."""
    lines: dict[KeyPath, int] = {(): 1}
    problems: list[Problem] = []
    try:
        data = _load(text, lines, problems)
    except yaml.reader.ReaderError as error:
        line = text[: error.position].count("\n") + 1
        what = f"a character that YAML does not allow (code {error.character})"
        raise ProblemsError(path, [Problem(line, "", f"not valid YAML: {what}")]) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = "; ".join(part for part in (error.context, error.problem) if part)
        if "\\t" in message:
            message = "YAML allows no tabs for indentation; indent with spaces"
        elif "flow" in message:
            message += "; inside { } and [ ] put texts with punctuation in quotes"
        line = 1 if mark is None else mark.line + 1
        raise ProblemsError(path, [Problem(line, "", f"not valid YAML: {message}")]) from error
    except yaml.YAMLError as error:
        raise ProblemsError(path, [Problem(1, "", f"not valid YAML: {error}")]) from error
    except ValueError as error:  # a date such as 2026-13-45
        raise ProblemsError(path, [Problem(1, "", f"a value cannot be read: {error}")]) from error
    return Document(path, text, data, lines, tuple(problems))


class _Loader(yaml.SafeLoader):
    """A loader that refuses YAML nested deeper than `MAX_DEPTH`."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def fetch_flow_collection_start(self, token: type[yaml.Token]) -> None:
        """Begin a list or map in brackets; the scanner looks far ahead through them."""
        if self.flow_level >= MAX_DEPTH:
            raise yaml.scanner.ScannerError(
                None, None, f"it is nested deeper than {MAX_DEPTH} levels", self.get_mark()
            )
        super().fetch_flow_collection_start(token)

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node and those below it."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]  # PyYAML's
            raise yaml.composer.ComposerError(
                None, None, f"it is nested deeper than {MAX_DEPTH} levels", mark
            )
        try:
            node: yaml.Node | None = super().compose_node(parent, index)
            return node
        finally:
            self._depth -= 1


def _load(text: str, lines: dict[KeyPath, int], problems: list[Problem]) -> Any:
    loader = _Loader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _walk(node, (), lines, problems, ())
        return loader.construct_document(node)
    finally:
        loader.dispose()


def _walk(
    node: yaml.Node,
    path: KeyPath,
    lines: dict[KeyPath, int],
    problems: list[Problem],
    above: tuple[yaml.Node, ...],
) -> None:
    if any(node is ancestor for ancestor in above):
        raise yaml.constructor.ConstructorError(
            None, None, "a part contains itself through an alias", node.start_mark
        )
    if len(lines) > MAX_KEYS:
        raise yaml.constructor.ConstructorError(
            None, None, f"it has more than {MAX_KEYS} entries, aliases counted", node.start_mark
        )
    inner = (*above, node)
    if isinstance(node, yaml.MappingNode):
        first_line: dict[str, int] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in first_line:
                problems.append(
                    Problem(
                        line,
                        key_text((*path, key)),
                        f"given twice, first on line {first_line[key]}; keep one",
                    )
                )
            first_line.setdefault(key, line)
            lines[(*path, key)] = line
            _walk(value_node, (*path, key), lines, problems, inner)
    elif isinstance(node, yaml.SequenceNode):
        for i, item in enumerate(node.value):
            lines[(*path, i)] = item.start_mark.line + 1
            _walk(item, (*path, i), lines, problems, inner)

"""Words for levels in sentences, where these differ from the names in the data."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from visavis.analysis.statistics_report.outcome import Outcome, Question
from visavis.analysis.statistics_report.table_file import DataTable
from visavis.lab.errors import LabError

_MARK = re.compile("\ue000(\\d+)\ue001")
"""Stands for a level while a test runs: characters of Unicode's private use, which no data hold."""


@dataclass(frozen=True)
class LevelWords:
    """The levels of a question that have words of their own, in the order of their marks."""

    names: tuple[str, ...]
    words: tuple[str, ...]

    def with_marks(self, table: DataTable, question: Question) -> tuple[DataTable, Question]:
        """Return table and question with marks in place of these levels."""
        marks = {name: f"\ue000{i}\ue001" for i, name in enumerate(self.names)}
        cells = table.cells.copy()
        for factor in question.levels:
            cells[factor] = cells[factor].map(lambda name: marks.get(name, name))
        levels = {f: tuple(marks.get(v, v) for v in of) for f, of in question.levels.items()}
        return replace(table, cells=cells), replace(question, levels=levels)

    def with_words(self, outcome: Outcome, question: Question) -> Outcome:
        """Return an outcome to `question` with words in its sentences, else the levels' names."""
        data = outcome.data
        if data is not None:
            renamed_columns = {
                f: data[f].cat.rename_categories(self._in_names)
                for f in question.levels
                if f in data  # tests of agreement have the thing rated in their place
            }
            data = data.assign(**renamed_columns)
        return replace(
            outcome,
            question=question,
            data=data,
            **{
                name: self._each(getattr(outcome, name), self._in_words)
                for name in ("title", "sentences", "path", "contrast_sentences", "notes")
            },
            **{
                name: self._each(getattr(outcome, name), self._in_names)
                for name in ("rows", "contrasts", "cells")
            },
            samples=tuple(
                replace(
                    s,
                    name=self._in_names(s.name),
                    title=self._in_words(s.title),
                    conditions=renamed_columns,
                )
                for s in outcome.samples
                for renamed_columns in [{self._in_names(k): v for k, v in s.conditions.items()}]
            ),
        )

    def put_words_in(self, error: LabError) -> None:
        """Put words in place of the marks in what an error says."""
        error.args = self._each(error.args, self._in_words)

    def _each(self, content: Any, put: Callable[[str], str]) -> Any:
        if isinstance(content, str):
            return put(content)
        if isinstance(content, tuple):
            return tuple(self._each(one, put) for one in content)
        if isinstance(content, Mapping):
            return {put(k): self._each(v, put) for k, v in content.items()}
        return content

    def _in_words(self, text: str) -> str:
        return _MARK.sub(lambda mark: self.words[int(mark[1])], text)

    def _in_names(self, text: str) -> str:
        return _MARK.sub(lambda mark: self.names[int(mark[1])], text)


def level_words_of(question: Question) -> LevelWords | None:
    """Return the levels of a question that have words of their own; None where none has."""
    levels = dict.fromkeys(level for of in question.levels.values() for level in of)
    other = [level for level in levels if question.wording.level_words.get(level, level) != level]
    if not other:
        return None
    return LevelWords(tuple(other), tuple(question.wording.level_words[level] for level in other))

"""The pieces of a report page as data; all text is plain and is escaped when it is rendered."""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Mark: TypeAlias = Literal["", "agree", "differ", "strong", "weak"]
Status: TypeAlias = Literal["found", "partly", "reversed", "not_found", "undecided"]


@dataclass(frozen=True)
class Cell:
    """One table cell; `mark` sets its look, `hint` is shown on pointing at it.

    With a `link` it leads to a page beside the report, with a `command` it copies that.
    """

    text: str
    mark: Mark = ""
    hint: str = ""
    link: str = ""
    command: str = ""


@dataclass(frozen=True)
class Column:
    """A table column; neighbours with the same `group` get one heading above them.

    "tight" stands close to the column on its left (stars after a p value).
    """

    header: str
    align: Literal["left", "right", "centre", "tight"] = "left"
    group: str = ""


@dataclass(frozen=True)
class Table:
    """A table whose first column names the row; it scrolls sideways on narrow screens."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell | str, ...], ...]
    caption: str
    note: str = ""

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows, 1):
            if len(row) != len(self.columns):
                raise ValueError(
                    f"row {i} of table {self.caption!r} has {len(row)} cells for "
                    f"{len(self.columns)} columns"
                )


@dataclass(frozen=True)
class Picture:
    """An SVG figure, with the words a reader gets who cannot see it.

    `data` is what it shows as the text of a CSV file, to be taken along with the figure.
    """

    svg: str
    title: str
    caption: str
    alternative: str
    data: str = ""


@dataclass(frozen=True)
class Photo:
    """A JPEG picture: the place as a participant saw it."""

    jpeg: bytes
    caption: str
    alternative: str


@dataclass(frozen=True)
class Paragraph:
    """Running text."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Names with their values."""

    pairs: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Verdict:
    """One question of the study with its answer; a secondary one is exploratory."""

    status: Status
    headline: str
    detail: str
    is_secondary: bool = False


@dataclass(frozen=True)
class Verdicts:
    """The answers a reader came for."""

    items: tuple[Verdict, ...]


@dataclass(frozen=True)
class Opening:
    """The first screen: the answer to the study's question, beside the figure that shows it."""

    answer: Verdict
    picture: Picture | None = None
    place: Photo | None = None


@dataclass(frozen=True)
class Code:
    """Lines to be copied: commands, hashes."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Fold:
    """Blocks behind a line that opens them; printed as they stand, open or closed."""

    summary: str
    blocks: "tuple[Block, ...]"


Block: TypeAlias = (
    Paragraph | Bullets | Facts | Opening | Verdicts | Table | Picture | Photo | Code | Fold
)


@dataclass(frozen=True)
class Section:
    """A headed part of the page; `anchor` is its stable address."""

    anchor: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A whole report. `is_simulated` puts a banner on every screen and every printed sheet."""

    title: str
    subtitle: str
    facts: Facts
    is_simulated: bool
    sections: tuple[Section, ...]
    language: str = "en"
    footer: str = field(default="")

"""Write the pages of `docs/reference` from the code: columns, keywords of a study, drivers.

`python -m tools.reference_pages` writes them; a test holds the pages that are there to the code.
"""

import ast
import dataclasses
import inspect
import sys
import textwrap
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from visavis.devices.registry import built_in
from visavis.devices.spec import AnySpec
from visavis.lab.config import load_config
from visavis.lab.config_files import EXAMPLE
from visavis.protocol.plan.columns import Column
from visavis.results.opened_study import find_study
from visavis.results.quality import QUALITY_TABLE
from visavis.results.tables.dictionary import PEOPLE, STATISTICS, people_columns, trial_columns
from visavis.study.catalogue import SHIPPED_STUDIES
from visavis.study.declaration import PARTS

FOLDER: Final = Path(__file__).parents[1] / "docs" / "reference"
WRITTEN: Final = "Written from the code by `python -m tools.reference_pages`; do not edit."
SET_BY_OTHERS: Final = ("makers", "path", "plan_folder")
"""Fields of a study that its decorators set, and what reads or derives it."""
WIRING: Final = {
    "eye tracker": "eye-trackers.md",
    "headset": "headsets.md",
    "armband": "armbands.md",
    "body tracker": "body-trackers.md",
    "responses": "screens.md",
    "triggers": "eeg.md",
}
"""Where the wiring of each kind is told."""
WIRING_OF: Final = {
    "ble_sensor": "sensors.md",
    "lsl_stream": "synchronisation.md",
    "screen_display": "screens.md",
}


def pages() -> dict[str, str]:
    """Return every page's text by its path below `docs/reference`."""
    pages = {f"data/{name}.md": _data_page(name) for name in SHIPPED_STUDIES}
    pages["data/statistics.md"] = _statistics_page()
    pages["study.md"] = _study_page()
    specs = [spec for _, spec in sorted(built_in().items())]
    pages |= {f"devices/{spec.name}.md": _device_page(spec) for spec in specs}
    pages["README.md"] = _index(specs)
    return pages


def _index(specs: Iterable[AnySpec]) -> str:
    kinds: dict[str, list[AnySpec]] = {}
    for spec in specs:
        kinds.setdefault(spec.kind, []).append(spec)
    lines = ["# Reference", "", WRITTEN, "", "- [Keywords of a study](study.md)", ""]
    lines += ["## Tables of each study", ""]
    lines += [f"- [{find_study(name).study.title}](data/{name}.md)" for name in SHIPPED_STUDIES]
    lines += ["- [statistics and contrasts of all of them](data/statistics.md)", ""]
    lines += ["## Drivers and their settings", ""]
    for kind in sorted(kinds):
        lines += [
            f"**{kind}**: "
            + ", ".join(f"[{spec.name}](devices/{spec.name}.md)" for spec in kinds[kind]),
            "",
        ]
    return "\n".join(lines)


# ---- studies -------------------------------------------------------------------------------------


def _study_page() -> str:
    """Return the keywords of `Study`, part by part; those that nobody writes are left out."""
    lines = [
        "# Keywords of a study",
        "",
        WRITTEN,
        "",
        'Beside its name, title, question and `version="1"` a `Study` takes what follows, each',
        'by its name: `Study("duel", factors=[…], repetitions=5)`. The headings are the parts',
        "from which a script reads it: `study.design.repetitions`.",
        "",
    ]
    for part, kind in PARTS.items():
        keywords = [
            f
            for f in dataclasses.fields(kind)
            if not f.name.endswith("_of") and f.name not in SET_BY_OTHERS
        ]
        if not keywords:
            continue
        explained = docs_below(kind)
        lines += [f"## {part}", "", str(inspect.getdoc(kind)), ""]
        lines += ["| keyword | default | what it is |", "| --- | --- | --- |"]
        lines += [
            f"| `{f.name}` | {_default_of(f)} | {_cell(explained[f.name])} |" for f in keywords
        ]
        lines.append("")
    return "\n".join(lines)


def docs_below(kind: type) -> dict[str, str]:
    """Return what stands below each field of a class in its source."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    return {
        field.target.id: below.value.value
        for field, below in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    }


def _default_of(field: "dataclasses.Field[Any]") -> str:
    if field.name == "exclusions":
        return "`STANDARD_RULES`"
    if field.default is dataclasses.MISSING or field.default in (None, ()):
        return ""
    return f"`{field.default!r}`"


# ---- tables --------------------------------------------------------------------------------------


def _data_page(name: str) -> str:
    opened = find_study(name)
    experiment = opened.experiment({})
    asked = opened.questionnaires(load_config(EXAMPLE))
    trials = trial_columns(experiment, opened.measures(experiment))
    people = people_columns(asked) | {c.name: c for c in QUALITY_TABLE}
    return "\n".join(
        [
            f"# {opened.study.title}: what the columns are",
            "",
            WRITTEN,
            "",
            f"`visavis analyse {name}` writes each table as `.csv` beside a `.json` that says the "
            "same.",
            "",
            "## trials.csv: one row per trial performed",
            "",
            *_columns(trials.values()),
            "",
            "`SCENE_on_ns`, `SCENE_off_ns` and `SCENE_frames` tell when each scene came and went "
            "(session time) and how many frames showed it.",
            "",
            "## participants.csv: one row per participant",
            "",
            *_columns(people.values()),
            "",
        ]
    )


def _statistics_page() -> str:
    return "\n".join(
        [
            "# statistics.csv and contrasts.csv: what the columns are",
            "",
            WRITTEN,
            "",
            "A table has those columns that its tests fill.",
            "",
            *_columns({c.name: c for c in (*PEOPLE[:1], *STATISTICS)}.values()),
            "",
        ]
    )


def _columns(columns: Iterable[Column]) -> Iterator[str]:
    yield "| column | unit | what it is |"
    yield "| --- | --- | --- |"
    for column in columns:
        levels = "; ".join(f"{value}: {words}" for value, words in column.levels.items())
        said = _cell(f"{column.description}{f' ({levels})' if levels else ''}")
        yield f"| `{column.name}` | {_cell(column.unit)} | {said} |"


# ---- drivers -------------------------------------------------------------------------------------


def _device_page(spec: AnySpec) -> str:
    model: type[BaseModel] = spec.options
    role = {
        "eye tracker": "eye_tracker",
        "body tracker": "body_tracker",
        "armband": "armband_left_forearm",
    }.get(spec.kind, spec.kind.replace(" ", "_"))
    needed = [name for name, field in model.model_fields.items() if field.is_required()]
    more = "".join(f", {name}: …" for name in needed)
    wiring = WIRING_OF.get(spec.name) or WIRING.get(spec.kind, "devices.md")
    facts = [
        ("device", spec.claims.stands_for or spec.product.model),
        ("kind", spec.kind),
        ("wire", spec.wire.medium),
        ("can", ", ".join(sorted(c.replace("_", " ") for c in spec.product.capabilities)) or "–"),
        ("checked against", spec.claims.checked or "–"),
        ("not yet proven", spec.claims.unproven or "–"),
    ]
    lines = [
        f"# {spec.name}",
        "",
        WRITTEN,
        "",
        *(f"- **{name}**: {value}" for name, value in facts if value),
        f"- **when it is not there**: {spec.remedy}" if spec.remedy else "",
        f"- wiring, axes and what to look out for: [{wiring.removesuffix('.md')}](../../{wiring})",
        "",
        "```yaml",
        "# lab_config.yaml",
        "devices:",
        f"  {role}: {{driver: {spec.name}{more}}}",
        "```",
        "",
        "`simulated: true` beside it puts a simulator at the other end of the wire.",
        "",
        "| setting | default | may be |",
        "| --- | --- | --- |",
        *(_setting(name, field) for name, field in model.model_fields.items()),
        "",
    ]
    return "\n".join(line for i, line in enumerate(lines) if line or lines[i - 1])


def _setting(name: str, field: FieldInfo) -> str:
    if field.is_required():
        default = "**needed**"
    else:
        default = f"`{_shown(field.get_default(call_default_factory=True))}`"
    bounds = {
        "ge": "from {}",
        "gt": "above {}",
        "le": "to {}",
        "lt": "below {}",
        "min_length": "at least {} long",
        "max_length": "at most {} long",
    }
    said = [
        words.format(_shown(value))
        for rule in field.metadata
        for key, words in bounds.items()
        if (value := getattr(rule, key, None)) is not None
    ]
    parts = [field.description or "", _type_of(field.annotation), " ".join(said)]
    return f"| `{name}` | {_cell(default)} | {_cell('; '.join(p for p in parts if p))} |"


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, tuple | list | frozenset):
        return "[" + ", ".join(map(_shown, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str) and (not value or " " in value):
        return f'"{value}"'
    return f"{value:g}" if isinstance(value, float) else str(value)


def _type_of(annotation: Any) -> str:
    arguments = [a for a in getattr(annotation, "__args__", ()) if a is not type(None)]
    if len(arguments) == 1 and type(None) in annotation.__args__:
        return _type_of(arguments[0])
    if "Literal" in str(annotation):
        return " or ".join(f"`{a}`" for a in arguments if isinstance(a, str | int))
    names = {"int": "a whole number", "float": "a number", "str": "a text", "bool": "true or false"}
    return names.get(getattr(annotation, "__name__", ""), "a list" if arguments else "")


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def main() -> None:
    """Write every page, and delete those that nothing writes any more."""
    wanted = pages()
    for path in FOLDER.rglob("*.md"):
        if path.relative_to(FOLDER).as_posix() not in wanted:
            path.unlink()
    for name, text in wanted.items():
        path = FOLDER / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8", newline="\n")
    sys.stdout.write(f"{len(wanted)} pages in {FOLDER}\n")


if __name__ == "__main__":
    main()

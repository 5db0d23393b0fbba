"""What the documentation tells to type exists: every verb, every option, every quoted message."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import typer

from tests.product_files import product_files
from visavis.cli.app import app
from visavis.protocol.session.session_setup import LOST_DEVICE_S
from visavis.results.opened_study import find_study
from visavis.study.catalogue import SHIPPED_STUDIES, is_file

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "experiments").rglob("*.md"),
        *(ROOT / "changelog.d").glob("*.md"),
    ]
)
FENCED = re.compile(r"^```\w*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"`(?:\.venv/bin/)?(visavis [^`]+)`")
TYPED = re.compile(r"^(?:\$ )?(?:\.venv/bin/)?(visavis .+)$", re.MULTILINE)
SECTION = re.compile(r"^(?=#{1,2} )", re.MULTILINE)
MEASURED = re.compile(
    r"\b((took|came to)\b[^.|]{0,20}\d|(was|were) measured|[Pp]roven\b|processor seconds|CPU s\b"
    r"|p99|percentile|on a (quiet|busy|shared) computer|(samples|frames) a second|F1 of)"
    r"|[|] (simulated|measured) [|]"
)
"""Words that go with a figure that somebody found rather than chose."""
PRINTED_BY = re.compile(r"(?:python -m |`)((?:benchmarks|tests|tools)\.[a-z_.]+)")
OF_PAST_VERSIONS = "CHANGELOG.md"


def commands_of(page: Path) -> Iterator[list[str]]:
    """Yield the words of every command on a page."""
    text = page.read_text("utf-8")
    found = [line for block in FENCED.findall(text) for line in TYPED.findall(block)]
    found += [" ".join(line.split()) for line in INLINE.findall(FENCED.sub("", text))]
    for line in found:
        yield shlex.split(line, comments=True)[1:]


@cache
def whole_program() -> Any:
    """Return the program with all its commands, which takes a tenth of a second to build."""
    return typer.main.get_command(app)


def problem_of(words: list[str]) -> str:
    """Say what of a command does not exist; nothing when all of it does."""
    command = whole_program()
    rest = list(words)
    context = command.context_class(command)
    while hasattr(command, "list_commands") and rest:
        default = getattr(command, "default_name", "")
        if default and rest[0] not in command.list_commands(context):
            rest.insert(0, default)
        if rest[0].startswith("-"):
            break
        name = rest.pop(0).rstrip(".,;:")
        if not re.fullmatch(r"[a-z-]+", name):
            return ""  # VERB, plan|preview
        if name not in command.list_commands(context):
            return f"no command {name!r}"
        command = command.get_command(context, name)
        context = command.context_class(command, parent=context)
    known = {option for p in command.get_params(context) for option in (*p.opts, *p.secondary_opts)}
    wanted = {w.partition("=")[0].rstrip(".,;:)") for w in rest if re.match(r"--?[a-z]", w)}
    unknown = wanted - known - {"--help"}
    return f"{' '.join(words[:2])} has no {', '.join(sorted(unknown))}" if unknown else ""


TAKE_A_STUDY = (
    "run",
    "plan",
    "simulate",
    "serve",
    "board",
    "lock",
    "prepare",
    "power",
    "fidelity",
    "participant add",
    "participant list",
    "participant withdraw",
    "participant information",
)


def test_every_command_that_takes_a_study_names_one_that_can_be_found() -> None:
    strangers = []
    for page in (p for p in PAGES if p.name != OF_PAST_VERSIONS):
        of_lab = re.findall(r"^  (\w+): \S+\.py$", page.read_text("utf-8"), re.MULTILINE)
        for words in commands_of(page):
            verb = " ".join(words[:2]) if words[:1] == ["participant"] else " ".join(words[:1])
            rest = words[len(verb.split()) :]
            if verb not in TAKE_A_STUDY or not rest or rest[0].startswith(("-", "[", "<", "…")):
                continue
            name = rest[0].rstrip(".,;:")
            is_known = name in (*SHIPPED_STUDIES, *of_lab) or is_file(name)
            if not (is_known or name.isupper() or "…" in name):
                strangers.append(f"{page.relative_to(ROOT)}: {' '.join(words)}")
    assert [] == strangers


def test_every_command_on_a_page_exists_with_its_options() -> None:
    commands = {page: list(commands_of(page)) for page in PAGES if page.name != OF_PAST_VERSIONS}
    assert sum(map(len, commands.values())) > 150
    problems = {
        f"{page.relative_to(ROOT)}: {' '.join(words)}": said
        for page, typed in commands.items()
        for words in typed
        if (said := problem_of(words))
    }
    assert {} == problems


def test_a_trial_shown_in_the_readme_is_a_picture_which_takes_seconds() -> None:
    shown = [words for words in commands_of(ROOT / "README.md") if words[0] == "preview"]
    assert shown
    assert all("--png" in words and "--video" not in words for words in shown)


def unfounded(text: str) -> list[str]:
    """Return the measured figures of sections that name no command that prints them."""
    told = []
    for section in SECTION.split(FENCED.sub(lambda block: block[1], text)):
        if not PRINTED_BY.search(section):
            for paragraph in re.split(r"\n\s*\n", section):
                flat = " ".join(paragraph.split())
                if MEASURED.search(flat) and re.search(r"\d", flat):
                    told.append(flat[:120])
    return told


def test_a_section_with_a_measured_figure_names_the_command_that_prints_it() -> None:
    pages = [
        p for p in PAGES if p.parent.name in ("docs", ROOT.name) and p.name != OF_PAST_VERSIONS
    ]
    problems = {p.name: found for p in pages if (found := unfounded(p.read_text("utf-8")))}
    assert {} == problems


def test_a_figure_without_a_command_is_found() -> None:
    assert ["A film took 12 s."] == unfounded("# Films\n\nA film took 12 s.\n")
    assert [] == unfounded("# Films\n\nA film took 12 s (`python -m benchmarks.page_films`).\n")


def test_every_command_that_prints_figures_exists() -> None:
    pages = [p for p in PAGES if p.name != OF_PAST_VERSIONS]
    named = {n.rstrip(".") for p in pages for n in PRINTED_BY.findall(p.read_text("utf-8"))}
    assert len(named) > 30
    missing = []
    for name in named:
        place = ROOT.joinpath(*name.split("."))
        if not (place.is_dir() or place.with_suffix(".py").exists()):
            missing.append(name)
    assert [] == missing


def test_a_misspelt_verb_and_option_are_found() -> None:
    assert "no command 'simluate'" == problem_of(["simluate", "stare"])
    assert "simulate stare has no --people" == problem_of(["simulate", "stare", "--people", "3"])


def test_messages_quoted_in_troubleshooting_are_those_of_the_code() -> None:
    code = "\n".join(path.read_text("utf-8") for path in product_files())
    page = (ROOT / "docs" / "troubleshooting.md").read_text("utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")]
    quoted = [text for row in rows for text in re.findall(r"`([^`]+)`", row)]
    assert len(quoted) > 15
    # What the code fills in: a language, a side.
    filled = {"has no es.yaml", "left_eye_lost", "right_eye_lost"}
    assert [] == [text for text in quoted if text not in code and text not in filled]


def test_the_study_for_newcomers_from_elsewhere_plans_its_trials(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "coming-from.md").read_text("utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "duel.py").write_text(code, "utf-8")
    plan = find_study(str(tmp_path / "duel.py")).experiment({}).plan(0, 1)
    assert (20, 2) == (
        sum(not t.is_practice for t in plan.trials),
        sum(t.is_practice for t in plan.trials),
    )


def test_pages_say_how_long_a_session_waits_for_a_device() -> None:
    assert 5 * 60.0 == LOST_DEVICE_S
    for name in ("operator.md", "operator-card.md", "troubleshooting.md"):
        assert "five minutes" in " ".join((ROOT / "docs" / name).read_text("utf-8").split())

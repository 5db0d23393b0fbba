"""The module of each command, so that a command starts without importing the others.

A new command is a new line here. `tests/cli/test_command_table.py` compares the lines with the
modules.
"""

import difflib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NamedTuple

import typer
import typer.main
from typer.core import TyperCommand, TyperGroup

from visavis.lab.garbage import import_to_stay


class Entry(NamedTuple):
    """The module of `visavis.cli.commands` with a command, and the first line of its help."""

    module: str
    help: str


COMMANDS: Mapping[str, Entry] = {
    "init": Entry("data", "Write a lab_config.yaml to start from: everything simulated."),
    "doctor": Entry("doctor", "Say in one screen what is there, what is missing and what to do."),
    "new": Entry("new", "Write a study to begin with: its file, its texts, and a test."),
    "examples": Entry("examples", "Write ready studies and scripts into a folder."),
    "completion": Entry("completion", "Let your shell complete the commands and their options."),
    "devices": Entry("devices", "What devices there are, and whether they work."),
    "sync-test": Entry(
        "sync",
        "Measure how late picture, sound and vibration are here: delay, jitter, drift, lost "
        "frames.",
    ),
    "participant": Entry("participant", "Issue, list and withdraw participant identifiers."),
    "plan": Entry("session", "Show the order of all trials before anything runs."),
    "fidelity": Entry(
        "fidelity",
        "Show what a study's source says beside what the study does: same, stronger or different.",
    ),
    "lock": Entry("lock", "Freeze what a study plans, before its results are looked at."),
    "prepare": Entry(
        "prepare", "Compute what a study needs beforehand, such as the evening before."
    ),
    "run": Entry(
        "session",
        "Perform one session on the devices of lab_config.yaml, or on a page in a browser.",
    ),
    "serve": Entry(
        "serving", "Serve a study to many participants at once, each with a session of their own."
    ),
    "board": Entry(
        "serving",
        "Show who of a study on pages is where: trials, time, flags, who left, who stopped.",
    ),
    "export-web": Entry(
        "elsewhere", "Write a study as files for JATOS or any web host, where no server can run."
    ),
    "import-web": Entry(
        "elsewhere", "Record what people did with a study that was written for another host."
    ),
    "resume": Entry(
        "session",
        "Go on with an interrupted session: instructions, calibration, then the trials left.",
    ),
    "desk": Entry(
        "desk",
        "Show today's people, the doctor's findings and the running session on a page here.",
    ),
    "check": Entry("checking", "Can they leave? Compare what was planned with what was recorded."),
    "quality": Entry(
        "quality",
        "Write a page on a session's gaze: accuracy, precision, loss, rate, latency, pupil.",
    ),
    "note": Entry("remarks", "Note something on a person or a trial after the session."),
    "exclude": Entry("remarks", "Leave out a person or a trial by hand, with reason and author."),
    "recover": Entry("checking", "Take stock of a crashed session; raw files are never changed."),
    "preview": Entry(
        "preview",
        "Show a trial as its participant sees it: a simulated participant performs it.",
    ),
    "redraw": Entry(
        "redraw",
        "Draw what a participant was shown in one frame, as it was; boards and own body with it.",
    ),
    "demo": Entry("study", "Simulate a small stare-in-the-crowd study and analyse it."),
    "simulate": Entry("study", "Simulate a whole study on the virtual clock, on all cores."),
    "view": Entry(
        "view",
        "Write a page that shows a session again: the scene, gaze, body, contacts, every stream.",
    ),
    "film": Entry(
        "film",
        "Film a recorded trial of any study by a camera of your choice, whatever was drawn in it.",
    ),
    "gaze-map": Entry(
        "gaze_map",
        "Draw how long people looked where, by condition, and where conditions differ.",
    ),
    "replay": Entry(
        "replay",
        "Perform a recorded session again, and say where the two first differ.",
    ),
    "analyse": Entry("study", "Write one tidy row per trial, statistics, figures and the report."),
    "report": Entry("study", "Make the study's self-contained HTML report and say where it lies."),
    "power": Entry(
        "power",
        "Find the number of participants a study needs, by simulating it many times.",
    ),
    "stats": Entry(
        "statistics",
        "Test a table: print table, sentences, decision path and contrasts; write them with "
        "figures.",
    ),
    "warp": Entry("warp", "Warp a motion so that an observer perceives more or less of it."),
    "blend": Entry(
        "blend", "Blend example walks by adjectives, features or weights, and write the walk."
    ),
    "gesture": Entry(
        "gesture", "Perform a gesture script: arms by lexeme, the body as a speaker would move it."
    ),
    "corpus": Entry("gesture", "A speaker's recordings: what they teach."),
    "character": Entry("character", "People for scenes: list them, import your own, look at them."),
    "import": Entry("data", "Read data recorded by other programs."),
    "export": Entry(
        "export", "Copy sessions, people and motions into files that other programs read."
    ),
}
"""Commands in the order of the help."""


class LazyGroup(TyperGroup):
    """Import a command's module when the command is asked for; list them without any import."""

    _is_listing = False

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; for the list of commands in the help, a stub with its first line."""
        if cmd_name not in COMMANDS:
            near = difflib.get_close_matches(cmd_name, COMMANDS, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]!r}?" if near else "see visavis --help"
            ctx.fail(f"there is no command {cmd_name!r}; {hint}")
        if self._is_listing:
            return TyperCommand(cmd_name, help=COMMANDS[cmd_name].help)
        return load_command(cmd_name)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help from the table as plain text: the library that frames it loads slowly."""
        with self._listing():
            markup_mode, self.rich_markup_mode = self.rich_markup_mode, None
            try:
                super().format_help(ctx, formatter)
            finally:
                self.rich_markup_mode = markup_mode

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write every command's line in full."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, entry.help) for name, entry in COMMANDS.items()])

    def get_help_option(self, ctx: Any) -> Any:
        """Return --help with the default False: without a default typer loads pydantic."""
        option = super().get_help_option(ctx)
        if option is not None:
            option.default = False
        return option

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return the commands and options that begin with `incomplete`, from the table."""
        with self._listing():
            return super().shell_complete(ctx, incomplete)

    @contextmanager
    def _listing(self) -> Iterator[None]:
        self._is_listing = True
        try:
            yield
        finally:
            self._is_listing = False


def load_command(name: str) -> Any:
    """Import the module of a command and return the command it registers."""
    module = import_to_stay(f"visavis.cli.commands.{COMMANDS[name].module}")
    # Every module registers its command at the one application when it is imported.
    command_group: Any = typer.main.get_group(module.app)
    _name_arguments(command_group.commands[name])
    return command_group.commands[name]


def _name_arguments(command: Any) -> None:
    """Give a command's arguments readable names in its help: SESSION, not SESSION_PATH."""
    for below in getattr(command, "commands", {}).values():
        _name_arguments(below)
    for argument in command.params:
        if argument.param_type_name == "argument" and argument.metavar is None:
            argument.metavar = argument.name.upper().removesuffix("_PATH")

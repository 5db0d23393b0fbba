"""Ask questionnaires at the terminal."""

from collections.abc import Callable, Sequence

from rich.console import Console

from visavis.cli.app import verbatim


class TerminalRespondent:
    """Read answers from the keyboard; an empty line leaves a question out.

    `before_first` gives the terminal back from the operator's screen.
    """

    def __init__(self, console: Console, before_first: Callable[[], None]) -> None:
        self._console = console
        self._before_first: Callable[[], None] | None = before_first

    def answer(self, question_id: str, prompt: str, options: Sequence[str]) -> str | None:
        """Ask until the answer is one of the options, free text, or left out."""
        if self._before_first is not None:
            self._before_first()
            self._before_first = None
        self._console.print(f"\n[b]{verbatim(prompt)}[/b]")
        for number, option in enumerate(options, start=1):
            self._console.print(f"  {number}  {verbatim(option)}")
        while True:
            reply = self._console.input("> ").strip()
            if not reply:
                return None
            if not options:
                return reply
            if reply.isdigit() and 1 <= int(reply) <= len(options):
                return options[int(reply) - 1]
            if reply in options:
                return reply
            self._console.print(
                f"[yellow]Type a number from 1 to {len(options)}, or Enter to leave it out.[/]"
            )

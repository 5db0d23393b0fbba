"""The `visavis` command."""

import signal
import sys
from collections.abc import Sequence
from types import FrameType

from cli.app import app, errors
from lab.errors import LabError

EXIT_INTERRUPTED = 130
EXIT_INTERNAL = 1


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command; errors of ours become one message and their exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        app(args=None if arguments is None else list(arguments), standalone_mode=True)
    except LabError as error:
        errors.print(f"[bold red]error[/]  {_escaped(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(error.exit_code)
    except Exception:
        errors.print_exception(max_frames=12)
        errors.print(
            "[bold red]internal error[/]  this is a defect in Visavis, not of yours. Everything "
            "finished is on disk; `visavis resume` goes on with an interrupted session."
        )
        sys.exit(EXIT_INTERNAL)
    except KeyboardInterrupt:
        errors.print("[yellow]interrupted[/]; everything finished is kept")
        sys.exit(EXIT_INTERRUPTED)


def _terminate(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _escaped(text: str) -> str:
    return text.replace("[", r"\[")


if __name__ == "__main__":
    main()

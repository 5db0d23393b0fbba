"""The `visavis` command."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any, NoReturn

from visavis.cli.app import app, errors
from visavis.lab.errors import LabError

EXIT_INTERRUPTED = 130
EXIT_INTERNAL = 1
AGAIN_S = 0.02


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command; one of our errors becomes a message and its exit code."""
    signal.signal(signal.SIGTERM, _terminate)
    sys.unraisablehook = interrupting_again(sys.unraisablehook)
    try:
        app(args=None if arguments is None else list(arguments), standalone_mode=True)
    except LabError as error:
        errors.print(f"[bold red]error[/]  {_escaped(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(error.exit_code)
    except Exception as error:
        if _was_interrupted(error):
            _say_interrupted()
        from visavis.study.study_errors import users_mistake  # late: the help does not need it

        mistake = users_mistake(error)
        if mistake is not None:
            errors.print(
                f"[bold red]error[/]  {_escaped(str(mistake))}", highlight=False, soft_wrap=True
            )
            sys.exit(mistake.exit_code)
        errors.print_exception(max_frames=12)
        errors.print(
            "[bold red]internal error[/]  this is a defect in Visavis, not of yours. Everything "
            "finished is on disk; `visavis resume` goes on with an interrupted session."
        )
        sys.exit(EXIT_INTERNAL)
    except KeyboardInterrupt:
        _say_interrupted()


def _say_interrupted() -> NoReturn:
    errors.print("[yellow]interrupted[/]; everything finished is kept")
    sys.exit(EXIT_INTERRUPTED)


def _was_interrupted(error: BaseException) -> bool:
    """True for an interruption inside compiled code, which wraps it in a SystemError."""
    cause = error.__cause__ if isinstance(error, SystemError) else None
    return isinstance(cause, KeyboardInterrupt)


def _terminate(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def interrupting_again(otherwise: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Return a hook for exceptions that nobody can catch; `otherwise` gets all but interruptions.

    When a signal arrives while a library calls back into Python (numba does while it loads
    compiled code), its exception is dropped. Then the signal is sent again a little later.
    """

    def hook(unraisable: Any) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(AGAIN_S, _interrupt_main).start()
        else:
            otherwise(unraisable)

    return hook


def _interrupt_main() -> None:
    if hasattr(signal, "pthread_kill"):  # this also wakes a waiting main thread
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
    else:
        _thread.interrupt_main(signal.SIGTERM)


def _escaped(text: str) -> str:
    return text.replace("[", r"\[")


if __name__ == "__main__":
    main()

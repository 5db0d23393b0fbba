"""The `visavis` command."""

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any, NoReturn

from visavis.cli.app import app, errors
from visavis.lab.errors import LabError, UsageError

EXIT_INTERRUPTED = 130
EXIT_INTERNAL = 1
AGAIN_S = 0.02
OURS = "visavis"
"""The first part of the names of all our modules."""


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
        place = in_study_file(error)
        if place:
            from visavis.study.study_errors import explain  # late, as below

            message = f"{place}: {explain(error)}"
            errors.print(
                f"[bold red]error[/]  {_escaped(message)}", highlight=False, soft_wrap=True
            )
            sys.exit(UsageError.exit_code)
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


def in_study_file(error: BaseException) -> str:
    """Return file, line and function if an error arose in a study file, else "".

    The error is the study's if none of our functions was called later: errors inside NumPy or
    pandas come from what the study called.
    """
    from visavis.study.study_errors import MODULE_OF_STUDY  # late: the help does not need it

    place, trace = "", error.__traceback__
    while trace is not None:
        frame = trace.tb_frame
        module = str(frame.f_globals.get("__name__", ""))
        if module.startswith(MODULE_OF_STUDY):
            place = f"{frame.f_code.co_filename}, line {trace.tb_lineno} in {frame.f_code.co_name}"
        elif module.partition(".")[0] == OURS and frame.f_code.co_name != "__getattr__":
            place = ""
        trace = trace.tb_next
    return place


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

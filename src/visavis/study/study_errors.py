"""Errors in a study file: their place, and a message with the probable intention."""

import ast
import inspect
import re
import sysconfig
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, Final

from visavis.lab.errors import DesignError, LabError
from visavis.lab.yaml_lines import did_you_mean
from visavis.public_names import HOMES, public_object
from visavis.study.arguments import argument_names, new_name, unknown_argument
from visavis.study.trial import TrialScript

MODULE_OF_STUDY: Final = "visavis_study_"
"""Prefix of the module names under which study files are imported."""
FORMER_PACKAGES: Final = (
    "analysis", "cli", "devices", "experiments", "lab", "protocol", "recording", "stage", "stimuli",
)  # fmt: skip
"""What could be imported beside `visavis` until 0.2.0."""
MAX_VALUE_CHARS: Final = 60
"""A longer value is cut in a message."""
_INSTALLED: Final = tuple(
    dict.fromkeys(
        Path(folder)
        for name, folder in sysconfig.get_paths().items()
        if name in ("stdlib", "platstdlib", "purelib", "platlib", "scripts")
    )
)
_IMPORTED_NAME: Final = re.compile(r"cannot import name '(\w+)'")
_UNEXPECTED_ARGUMENT: Final = re.compile(
    r"(?:(?P<owner>\w+)\.)?(?P<called>\w+)\(\) got an unexpected keyword argument '(?P<given>\w+)'"
)

_IMPLICIT_ARGUMENTS: Final = frozenset(("base", "folder", "makers", "path", "plan_folder"))
"""Arguments set by decorators and the reader of a study file, besides all that end in "_of"."""


def explain(error: BaseException) -> str:
    """Return the cause of an error in terms that the author of a study file knows.

    For an unknown argument of the kit the message lists those that there are.
    """
    match = _UNEXPECTED_ARGUMENT.search(str(error)) if isinstance(error, TypeError) else None
    taker = None if match is None else _of_kit(match["owner"] or "", match["called"])
    if match is not None and taker is not None:
        callee = match["owner"] if match["called"] == "__init__" else match["called"]
        arguments = tuple(
            n
            for n in argument_names(taker)
            if not n.endswith("_of") and n not in _IMPLICIT_ARGUMENTS
        )
        return unknown_argument(str(callee), match["given"], arguments)
    own = isinstance(error, LabError)
    if not own and isinstance(error, AttributeError) and _is_of_kit(error.obj):
        names = tuple(n for n in dir(error.obj) if not n.startswith("_"))
        near = did_you_mean(error.name, names)
        hint = near if "did you mean" in near else ""
        return f"a {type(error.obj).__name__.lower()} has no {error.name!r}{hint}"
    moved = _what_moved(error) if isinstance(error, ImportError) else ""
    return str(error) if own else f"{type(error).__name__}: {error}{moved}"


def _what_moved(error: ImportError) -> str:
    """Return the end of a message on a name of ours that is not where it was; else nothing."""
    top = (error.name or "").partition(".")[0]
    if top not in (*FORMER_PACKAGES, "visavis"):
        return ""
    imported = _IMPORTED_NAME.search(str(error))  # Python 3.11 tells it in the message alone
    return new_name(imported[1] if imported else "", HOMES) or (
        "; if it comes from an older Visavis, docs/what-moved.md says what it is called now"
    )


def _is_of_kit(thing: object) -> bool:
    return type(thing).__module__.partition(".")[0] == "visavis"


def _of_kit(owner: str, function_name: str) -> Callable[..., Any] | None:
    for name in filter(None, (owner, function_name)):
        if name in HOMES:
            target = public_object(name)
            taker = (
                target
                if function_name in ("__init__", name)
                else getattr(target, function_name, None)
            )
            return taker if callable(taker) else None
    step = getattr(TrialScript, function_name, None) if owner in ("", "TrialScript") else None
    return step if callable(step) else None


def line_of(error: BaseException) -> str:
    """Return "FILE, line N" of the innermost frame of a study file that an error passed, or ""."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        if str(trace.tb_frame.f_globals.get("__name__", "")).startswith(MODULE_OF_STUDY):
            place = f"{trace.tb_frame.f_code.co_filename}, line {trace.tb_lineno}"
        trace = trace.tb_next
    return place


def users_mistake(error: BaseException) -> DesignError | None:
    """Return an error that passed through a user's file as a message on that file; None for others.

    The message names the file, the line, the function with what it was called with, and where in
    Visavis the error arose, if it was there. Errors that Visavis raises on purpose say this
    themselves: None comes back for them, too.
    """
    frame, line = _users_frame(error)
    # The interpreter's own errors are nobody's mistake.
    if frame is None or isinstance(error, LabError | SystemError | MemoryError):
        return None
    code, module = frame.f_code, "<module>"
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    arguments = ", ".join(f"{n}={_short(frame.f_locals[n])}" for n in names if n in frame.f_locals)
    where = f"{code.co_filename}, line {line}"
    where += "" if code.co_name == module else f" in {code.co_name}({arguments})"
    inner, inner_line = _innermost(error)
    is_inside = inner is not None and _is_ours(inner)
    at = f" (raised in {inner.f_globals.get('__name__')}, line {inner_line})" if is_inside else ""  # type: ignore[union-attr]  # is_inside says that it is there
    return DesignError(f"{where}: {explain(error)}{at}; correct it there")


@contextmanager
def users_mistakes() -> Iterator[None]:
    """Raise what arises in a user's file, or in what it calls, as a message on that file.

    Raises:
        DesignError: as `users_mistake` says it.
    """
    try:
        yield
    except Exception as error:
        mistake = users_mistake(error)
        if mistake is None:
            raise
        raise mistake from error


def _users_frame(error: BaseException) -> tuple[FrameType | None, int]:
    """Return the innermost frame of a study file that an error passed, else that of any file that
    belongs neither to Visavis nor to an installed package; with its line.
    """
    of_study: tuple[FrameType | None, int] = (None, 0)
    of_any: tuple[FrameType | None, int] = (None, 0)
    trace = error.__traceback__
    while trace is not None:
        frame = trace.tb_frame
        if str(frame.f_globals.get("__name__", "")).startswith(MODULE_OF_STUDY):
            of_study = frame, trace.tb_lineno
        elif not _is_ours(frame) and not _is_installed(frame.f_code.co_filename):
            of_any = frame, trace.tb_lineno
        trace = trace.tb_next
    return of_any if of_study[0] is None else of_study


def _innermost(error: BaseException) -> tuple[FrameType | None, int]:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return (None, 0) if trace is None else (trace.tb_frame, trace.tb_lineno)


def _is_ours(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0] == "visavis"


def _is_installed(file: str) -> bool:
    """Tell whether a file is of Python or an installed package, or is none."""
    path = Path(file)
    if not path.is_file() or {"site-packages", "dist-packages"} & set(path.parts):
        return True
    return any(path.is_relative_to(folder) for folder in _INSTALLED)


def _short(value: object) -> str:
    """Return a value as a message names it, in a few words."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a user's own __repr__ may fail, too
        text = type(value).__name__
    return text if len(text) <= MAX_VALUE_CHARS else f"{text[: MAX_VALUE_CHARS - 1]}…"


def line_reached(steps: Generator[Any, Any, Any]) -> str:
    """Return "FILE, line N" at which a generator of a study file waits, or ""."""
    place = ""
    at: object = steps
    while inspect.isgenerator(at) and at.gi_frame is not None:
        if str(at.gi_frame.f_globals.get("__name__", "")).startswith(MODULE_OF_STUDY):
            place = f"{at.gi_code.co_filename}, line {at.gi_frame.f_lineno}"
        at = at.gi_yieldfrom
    return place


def forgotten_yields(path: Path | None, steps: Iterable[str]) -> Iterator[tuple[int, str, str]]:
    """Yield line, answer and call of every step that a trial makes without yielding it.

    A step with a name counts where nothing but attributes of that name are read: it is taken for
    the answer. It is "answer = " then, else "".
    """
    if path is None or not path.is_file():
        return
    names = frozenset(steps)
    for function in ast.walk(ast.parse(path.read_bytes())):
        if not isinstance(function, ast.FunctionDef) or not function.args.args:
            continue
        marks = [d.attr for d in function.decorator_list if isinstance(d, ast.Attribute)]
        inner = list(ast.walk(function))
        if not {"trial", "intertrial"} & set(marks) and not any(
            isinstance(n, ast.Yield | ast.YieldFrom) for n in inner
        ):
            continue
        owners = {n.value for n in inner if isinstance(n, ast.Attribute)}
        reads = [n for n in inner if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)]
        arguments = {n.id for n in reads if n not in owners}
        statements = [(n.value, "") for n in inner if isinstance(n, ast.Expr)]
        statements += [
            (n.value, f"{n.targets[0].id} = ")
            for n in inner
            if isinstance(n, ast.Assign)
            and isinstance(n.targets[0], ast.Name)
            and n.targets[0].id not in arguments
        ]
        for call, answer in statements:
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and isinstance(call.func.value, ast.Name)
                and call.func.value.id == function.args.args[0].arg
                and call.func.attr in names
            ):
                yield call.lineno, answer, f"{call.func.value.id}.{call.func.attr}"


def line_saying(path: Path | None, word: str) -> str:
    """Return "FILE, line N" of the first string in a study file equal to this word, or ""."""
    if path is None or not path.is_file():
        return ""
    texts = ast.walk(ast.parse(path.read_bytes()))
    lines = [n.lineno for n in texts if isinstance(n, ast.Constant) and n.value == word]
    return f"{path}, line {min(lines)}" if lines else ""

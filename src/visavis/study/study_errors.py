"""Errors in a study file: their place, and a message with the probable intention."""

import ast
import inspect
import re
from collections.abc import Callable, Generator, Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from visavis.lab.errors import LabError
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
_IMPORTED_NAME: Final = re.compile(r"cannot import name '(\w+)'")
_UNEXPECTED_ARGUMENT: Final = re.compile(
    r"(?:(?P<owner>\w+)\.)?(?P<called>\w+)\(\) got an unexpected keyword argument '(?P<given>\w+)'"
)

_IMPLICIT_ARGUMENTS: Final = frozenset(("base", "folder", "makers", "path", "plan_folder"))
"""Arguments set by decorators and the reader of a study file, besides all that end in "_of"."""


def explain(error: BaseException) -> str:
    """Return the cause of an error in terms that the author of a study file knows.

    For an unknown argument of the kit the message lists the known ones.
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


def line_reached(steps: Generator[Any, Any, Any]) -> str:
    """Return "FILE, line N" at which a generator of a study file waits, or ""."""
    place = ""
    at: object = steps
    while inspect.isgenerator(at) and at.gi_frame is not None:
        if str(at.gi_frame.f_globals.get("__name__", "")).startswith(MODULE_OF_STUDY):
            place = f"{at.gi_code.co_filename}, line {at.gi_frame.f_lineno}"
        at = at.gi_yieldfrom
    return place


def forgotten_yields(path: Path | None, steps: Iterable[str]) -> Iterator[tuple[int, str]]:
    """Yield line and name of every step that a trial in a study file makes without yielding it."""
    if path is None or not path.is_file():
        return
    names = frozenset(steps)
    for function in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(function, ast.FunctionDef) or not function.args.args:
            continue
        marks = [d.attr for d in function.decorator_list if isinstance(d, ast.Attribute)]
        inner = list(ast.walk(function))
        if not {"trial", "intertrial"} & set(marks) and not any(
            isinstance(n, ast.Yield | ast.YieldFrom) for n in inner
        ):
            continue
        for call in (n.value for n in inner if isinstance(n, ast.Expr)):
            if (
                isinstance(call, ast.Call)
                and isinstance(call.func, ast.Attribute)
                and isinstance(call.func.value, ast.Name)
                and call.func.value.id == function.args.args[0].arg
                and call.func.attr in names
            ):
                yield call.lineno, f"{call.func.value.id}.{call.func.attr}"


def line_saying(path: Path | None, word: str) -> str:
    """Return "FILE, line N" of the first string in a study file equal to this word, or ""."""
    if path is None or not path.is_file():
        return ""
    texts = ast.walk(ast.parse(path.read_text("utf-8")))
    lines = [n.lineno for n in texts if isinstance(n, ast.Constant) and n.value == word]
    return f"{path}, line {min(lines)}" if lines else ""

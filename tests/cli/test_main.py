"""The command hears signals wherever it is, and says what it did about them."""

import ctypes
import re
import signal
import sys
import threading
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from tests.product_files import name_in_repository, product_files
from visavis.cli import main as command
from visavis.cli.app import console, errors, say, verbatim
from visavis.cli.main import interrupting_again
from visavis.cli.notifier import counting
from visavis.lab.config_files import EXAMPLE
from visavis.study.study_errors import MODULE_OF_STUDY, users_mistake


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.skipif(sys.platform == "win32", reason="Windows cannot send SIGTERM to itself")
def test_signal_dropped_by_a_library_that_calls_back_comes_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    dropped: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", interrupting_again(dropped.append))
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
    former = signal.signal(signal.SIGTERM, _interrupt)
    try:
        callback()
        with pytest.raises(KeyboardInterrupt):
            threading.Event().wait(10.0)  # it would go on as if nothing had been asked
    finally:
        signal.signal(signal.SIGTERM, former)
    assert [] == dropped


def test_other_exceptions_nobody_can_catch_go_to_the_hook_of_before() -> None:
    seen: list[object] = []
    unraisable = SimpleNamespace(exc_type=ValueError)
    interrupting_again(seen.append)(unraisable)
    assert [unraisable] == seen


@pytest.mark.usefixtures("hooks_restored")
def test_interruption_inside_compiled_code_is_an_interruption(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise SystemError("returned a result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr(command, "app", interrupted)
    with pytest.raises(SystemExit) as ended:
        command.main(["analyse"])
    assert 130 == ended.value.code
    assert "defect" not in capsys.readouterr().err


@pytest.mark.usefixtures("hooks_restored")
def test_system_error_of_another_cause_is_a_defect(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise SystemError("bad internal call")

    monkeypatch.setattr(command, "app", broken)
    with pytest.raises(SystemExit) as ended:
        command.main(["analyse"])
    assert 1 == ended.value.code
    assert "defect" in capsys.readouterr().err


STUDY_WITH_A_SLIP = """
from visavis import Factor, Scene, Study

study = Study("slip", factors=[Factor("gaze", ["averted", "directed"])])


@study.trial
def trial(t):
    yield t.show(Scene("person", eyes=t.gaze), seconds=t.scene_s)
"""


def test_a_slip_in_a_study_file_is_told_with_its_line_and_is_no_defect_of_ours(
    tmp_path: Path, hooks_restored: None, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "slip.py"
    study.write_text(STUDY_WITH_A_SLIP, "utf-8")
    (tmp_path / "lab_config.yaml").write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    lab = ["--config", str(tmp_path / "lab_config.yaml")]
    with pytest.raises(SystemExit) as ended:
        command.main(["run", str(study), "--participant", "1", "--fast", *lab])

    said = capsys.readouterr().err
    assert 2 == ended.value.code
    assert f"{study}, line 9: trial of gaze averted" in said.replace("\n", "")
    assert "no factor, parameter or step 'scene_s'" in said.replace("\n", " ")
    assert "internal error" not in said


def test_error_in_a_labs_own_module_is_the_study_files_whatever_the_module_is_called(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "devices.py").write_text("def gain():\n    return 1 / 0\n", "utf-8")
    study = tmp_path / "slip.py"
    study.write_text("import devices\n\n\ndef trial():\n    return devices.gain()\n", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    loader = SourceFileLoader(f"{MODULE_OF_STUDY}slip", str(study))
    module = ModuleType(loader.name)
    loader.exec_module(module)
    with pytest.raises(ZeroDivisionError) as caught:
        module.trial()
    mistake = users_mistake(caught.value)
    assert mistake is not None
    assert str(mistake).startswith(f"{study}, line 5 in trial(): ZeroDivisionError")


USERS = ":B: [red]left[/red] :smile:"


def test_text_of_the_user_is_printed_letter_for_letter() -> None:
    for printed_on in (console, errors):
        with printed_on.capture() as caught:
            printed_on.print(f"[b]{verbatim(USERS)}[/]")
        assert USERS == caught.get().strip()
    with console.capture() as caught:
        say(f"to {verbatim(USERS)}")
    assert f"to {USERS}" == caught.get().strip()
    bar = counting(console)
    bar.add_task(USERS, total=2)
    with console.capture() as caught:
        console.print(bar.get_renderable())
    assert caught.get().startswith(USERS)


def test_everything_is_printed_on_the_consoles_that_leave_colons_alone() -> None:
    made = [
        f"{name_in_repository(path)}: {line.strip()}"
        for path in product_files()
        for line in path.read_text("utf-8").splitlines()
        if re.search(r"= *\w*Console\(|rich\.print\(|from rich import print", line)
    ]
    assert {"src/visavis/cli/app.py"} == {line.partition(":")[0] for line in made}
    assert all("emoji=False" in line for line in made)

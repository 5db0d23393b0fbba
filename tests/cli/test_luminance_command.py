"""`visavis devices luminance`: from what a photometer says to a table that sessions use."""

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PIL import Image
from typer.testing import CliRunner, Result

from tests.cli.test_flat_again import performed
from tests.virtual_screen import run_before_a_screen
from visavis.analysis.session_check import check_session
from visavis.cli.luminance_sheet import measure, measured_steps
from visavis.cli.main import app
from visavis.cli.redraw import redraw
from visavis.lab.config import Screen, load_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import ConfigError, DeviceError, UsageError
from visavis.lab.luminance import table_of_entry
from visavis.running.sessions.perform import perform_rest
from visavis.running.sessions.session_request import simulated_request

ROOT = Path(__file__).parents[2]
LEVELS = (0, 32, 64, 96, 128, 160, 192, 224, 255)
STUDY = """
from visavis import Factor, Grating, Study

study = Study("again", factors=[Factor("side", ["left"])], calibrate=False)

@study.trial
def trial(t):
    yield t.show(Grating(20, 0.2, 0.5, mask="none"), seconds=0.3, background="grey")
"""


def light(level: float) -> float:
    return 0.4 + 120.0 * (level / 255) ** 2.2


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A lab with a monitor in the current folder, and a table of its luminances elsewhere."""
    monkeypatch.chdir(tmp_path)
    config = tmp_path / "lab_config.yaml"
    config.write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    rows = "".join(f"{level},{light(level):.4f}\n" for level in LEVELS)
    (tmp_path / "own.csv").write_text(f"level,cd_m2\n{rows}", "utf-8")
    (tmp_path / "again.py").write_text(STUDY, "utf-8")
    return config


def typed(*arguments: str, answers: str = "") -> Result:
    result = CliRunner().invoke(app, list(arguments), input=answers)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


def test_a_table_in_a_file_stands_beside_the_configuration_with_its_fit(lab: Path) -> None:
    said = typed("devices", "luminance", "own.csv").stdout
    assert "0.4 cd/m²  120.4 cd/m²   2.20" in said
    table = load_config(lab).luminance
    assert table is not None
    assert table.summary in " ".join(said.split())
    assert (LEVELS, "lab_config.luminance.csv") == (
        table.grey.levels,
        load_config(lab).luminance_path.name,
    )
    with pytest.raises(UsageError, match=r"luminance\.csv is there already; .*--replace"):
        typed("devices", "luminance", "own.csv")
    again = json.loads(typed("devices", "luminance", "own.csv", "--replace", "--json").stdout)
    assert 2.2 == pytest.approx(again["fits"]["grey"]["gamma"], abs=0.001)
    assert table.sha256 == again["sha256"]


def test_what_is_shown_is_asked_for_and_mistyped_values_again(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    colours: list[tuple[int, int, int]] = []

    @contextmanager
    def planted(screen: Screen) -> Iterator[Callable[[tuple[int, int, int], str], str]]:
        assert (1920, 1080) == (screen.width_px, screen.height_px)
        slips = iter(("much", "-3", "0,4", "0.4", "b"))  # the second 0.4 does not rise; back to 0

        def ask(rgb: tuple[int, int, int], prompt: str) -> str:
            colours.append(rgb)
            return next(slips, str(light(max(rgb))))

        yield ask

    monkeypatch.setattr("visavis.cli.luminance_sheet.full_field", planted)
    said = typed("devices", "luminance", "--levels", "6", "--guns").stdout
    assert 2 == said.count("a number of cd/m²")
    assert 1 == said.count("not more than 0.4")
    table = load_config(lab).luminance
    assert table is not None
    assert ["grey", "red", "green", "blue"] == [curve.gun for curve in table.curves]
    assert all((0, 51, 102, 153, 204, 255) == curve.levels for curve in table.curves)
    assert [(0, 0, 0)] * 3 + [(51, 51, 51)] * 2 + [(0, 0, 0), (51, 51, 51)] == colours[:7]
    assert [(255, 0, 0), (0, 0, 0), (0, 51, 0)] == colours[16:19]


def test_the_whole_window_is_filled_with_the_level_that_is_asked_for() -> None:
    output = run_before_a_screen(
        "tests.cli.full_field_child", size_px=(640, 480), keys="1\nb\n3,5\n4\n5\n"
    )
    answers = [line.rpartition("typed ")[2] for line in output.splitlines()]
    assert ["1", "b", "3,5", "4", "5"] == answers


def test_before_anything_else_is_shown_a_headset_is_refused(lab: Path) -> None:
    lab.write_text(EXAMPLE.read_text("utf-8"), "utf-8")
    with pytest.raises(UsageError, match="describes no screen"):
        typed("devices", "luminance", "own.csv")


def test_plan_says_whether_contrasts_are_of_light(lab: Path) -> None:
    assert "luminances were not measured" in " ".join(typed("plan", "again.py").stdout.split())
    typed("devices", "luminance", "own.csv")
    said = " ".join(typed("plan", "again.py").stdout.split())
    assert "greys and contrasts are of light: table" in said
    path = load_config(lab).luminance_path
    path.write_text(path.read_text("utf-8").replace("1920 x", "1024 x"), "utf-8")
    with pytest.raises(ConfigError, match="row 2: this was measured on another screen, 1024 x"):
        typed("plan", "again.py")


OUTSIDE = """
from visavis import Factor, Grating, Image, Study

study = Study("outside", factors=[Factor("strength", [0, 0.001, 0.5, 1])], calibrate=False)

@study.trial
def trial(t):
    stimuli = [Grating(20, 0.2, t.strength), Image("face.png", 4)]
    yield t.show(stimuli, seconds=0.3, background="grey")
"""


def test_plan_names_pictures_that_stay_and_contrasts_that_the_screen_has_not(lab: Path) -> None:
    (lab.parent / "outside.py").write_text(OUTSIDE, "utf-8")
    Image.new("RGB", (8, 8)).save(lab.parent / "face.png")
    before = typed("plan", "outside.py").stdout
    assert "keep their values" not in before
    typed("devices", "luminance", "own.csv")
    printed = typed("plan", "outside.py").stdout
    assert "pictures and films keep their values, which no table corrects\n" in printed
    assert "gratings of contrast 0.001 are below 0.0" in printed
    assert "gratings of contrast 1 are above 0.993, the greatest of this screen, and are" in printed
    assert "gratings of" not in typed("plan", "again.py").stdout


def test_a_session_is_drawn_by_its_table_again_and_resumed_with_no_other(
    tmp_path: Path, lab: Path
) -> None:
    typed("devices", "luminance", "own.csv")
    config = load_config(lab)
    table = config.luminance
    assert table is not None
    study, recording = performed(tmp_path / "again.py", STUDY, lab)
    entry = recording.manifest.configuration["luminance"]
    assert table == table_of_entry(entry)
    found = [f.message for f in check_session(recording).findings if f.subject == "luminance"]
    assert [f"greys and contrasts are of light: {table.summary}"] == found

    config.luminance_path.unlink()
    frames = recording.stream_arrays("frames", part=1)
    lit_ns = int(recording.trials().iloc[0]["stimulus_on_ns"]) + 100_000_000
    frame = int(frames["frame_index"][frames["t_host_ns"].searchsorted(lit_ns)])
    image, _ = redraw(study, recording, frame)
    row = image[image.shape[0] // 2, :, 0]
    brightest, darkest = light(float(row.max())), light(float(row.min()))
    assert 0.5 == pytest.approx((brightest - darkest) / (brightest + darkest), abs=0.01)

    request = simulated_request(study, study.experiment({}), config, label="S01", index=0, seed=1)
    with pytest.raises(ConfigError, match=rf"began with table {table.sha256[:12]}.* no table"):
        perform_rest(request, recording.path)


def test_a_level_at_which_the_photometer_reads_the_same_is_left_out() -> None:
    answers = iter(["", "0", "0", "", "8", "", "100"])  # neither end can be left out
    rows = measure(lambda rgb, prompt: next(answers), measured_steps(5, guns=False))
    assert [("grey", 0, 0.0), ("grey", 128, 8.0), ("grey", 255, 100.0)] == rows


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> list[str | BaseException]:
    """What somebody types before a planted window, in order; errors are raised."""
    typed_answers: list[str | BaseException] = []

    @contextmanager
    def planted(screen: Screen) -> Iterator[Callable[[tuple[int, int, int], str], str]]:
        def ask(rgb: tuple[int, int, int], prompt: str) -> str:
            answer = typed_answers.pop(0)
            if isinstance(answer, BaseException):
                raise answer
            return answer

        yield ask

    monkeypatch.setattr("visavis.cli.luminance_sheet.full_field", planted)
    return typed_answers


@pytest.mark.parametrize(
    "stop",
    [EOFError(), KeyboardInterrupt(), DeviceError("the window was closed", role="screen")],
    ids=["end of input", "Ctrl-C", "closed window"],
)
def test_what_was_typed_before_measuring_stopped_is_gone_on_from(
    lab: Path, answers: list[str | BaseException], stop: BaseException
) -> None:
    draft = lab.parent / "lab_config.luminance.partial.csv"
    answers += ["0.4", "", "8", stop]
    command = [*"devices luminance --levels 6".split()]
    stopped = CliRunner().invoke(app, command)
    assert stopped.exception is not None
    assert f"stands in {draft}; the same command goes on there" in stopped.stderr
    assert not load_config(lab).luminance_path.exists()
    with pytest.raises(UsageError, match="holds 3 luminances of other levels"):
        typed("devices", "luminance", "--levels", "9")

    answers += ["b", "9", "30", "60", "120", "240"]  # the third is corrected
    command = [*"devices luminance --levels 7".split()]
    draft.write_text(draft.read_text("utf-8").replace(",51,", ",42,").replace(",102,", ",85,"))
    assert "holds the first 3 of 7; go on from there?" in typed(*command, answers="y\n").stderr
    table = load_config(lab).luminance
    assert table is not None
    assert [(0, 0.4), (85, 9), (128, 30), (170, 60), (212, 120), (255, 240)] == [
        (level, cd_m2) for _, level, cd_m2 in table.rows
    ]
    assert not draft.exists()


def test_who_measures_anew_begins_with_the_first_level(
    lab: Path, answers: list[str | BaseException]
) -> None:
    command = "devices", "luminance", "--levels", "6"
    answers += ["5", EOFError()]
    CliRunner().invoke(app, [*command])
    answers += ["0", "1", "2", "3", "4", "5"]
    typed(*command, answers="n\n")
    table = load_config(lab).luminance
    assert table is not None
    assert (0.0, 1.0, 2.0, 3.0, 4.0, 5.0) == table.grey.cd_m2


def test_a_damaged_file_of_what_was_typed_is_refused_by_name(lab: Path) -> None:
    draft = lab.parent / "lab_config.luminance.partial.csv"
    draft.write_text("gun,level\ngrey,0\n", "utf-8")
    with pytest.raises(UsageError, match=r"partial\.csv, .*is damaged.*delete it to measure anew"):
        typed("devices", "luminance")

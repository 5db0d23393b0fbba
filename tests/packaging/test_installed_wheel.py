"""What `pip install` gives runs without the clone it was built from."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path
from typing import NamedTuple

import pytest
from numba.core.caching import UserProvidedCacheLocator

from tests.packaging.lab_folder import fill_lab_folder
from tests.packaging.test_fresh_install import absent_without, brought
from tests.product_files import PACKAGE, ROOMS_AT_THE_TOP
from tests.sessions import SHORT_STARE, STUDIES
from tests.store import STORE
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer

ROOT = Path(__file__).resolve().parents[2]
LEFT_BEHIND = shutil.ignore_patterns(
    ".*", "__pycache__", "build", "*.egg-info", "data", "demo", "out", "tests", "docs"
)
"""Of the clone: no earlier build may lend its files."""
ONE = ["--processes", "1"]
"""Two would load everything twice."""
ROOMS = [f"visavis.{p.name}" for p in PACKAGE.iterdir() if (p / "__init__.py").exists()]
CLONES = Path(os.environ["NUMBA_CACHE_DIR"])
"""Where machine code of the clone is kept: tests/conftest.py."""
LINKS = {f"visavis/{name}" for name in ROOMS_AT_THE_TOP}
EVERY_VERB = [
    "init",
    "plan ./duel.py",
    "preview ./duel.py --png duel.png --size 128x96",
    "run ./duel.py --participant 1 --fast --set repetitions=1",
    "check ./duel.py",
    "simulate ./duel.py --participants 3 --output dry --set repetitions=1 --processes 1",
    "analyse dry/simulated/duel --processes 1",
    "report ./duel.py --processes 1",
    "power ./duel.py --participants 4 --replicates 2 --fast --pool 5 --set repetitions=1 "
    "--processes 1 -o power",
    "replay ./duel.py --verify",
    "film ./duel.py --trial T01 -o trial.avi --seconds 0.2 --rate 5 --size 128x96",
    "view ./duel.py --trial T01 -o trial.html",
    "export ./duel.py -o out",
]
"""In the order a lab types them."""
DRAWING = {"preview", "film"}
IN_TURN = """
import sys
from visavis.cli.main import main

for verb in sys.argv[1:]:
    try:
        main(verb.split())
    except SystemExit as end:
        if end.code:
            sys.exit(f"{verb}: {end.code}")
"""
"""Does verbs in one process: in processes of their own, each would import everything again."""
WITHOUT_EXTRAS = """
import sys
from importlib.abc import MetaPathFinder

class Absent(MetaPathFinder):
    names = frozenset({absent!r})
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self.names:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""

pytestmark = pytest.mark.timeout(1200)


class Installed(NamedTuple):
    """An environment that has Visavis from a wheel, and the wheel."""

    programs: Path
    wheel: Path
    kernels: Path

    def run(self, program: str, *arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
        """Run a program of the environment; nothing of the clone is on its path."""
        return subprocess.run(
            [str(self.programs / program), *arguments],
            capture_output=True,
            text=True,
            check=False,
            cwd=cwd,
            env={
                **without_the_clone(),
                "PYTHONNOUSERSITE": "1",
                "COLUMNS": "200",
                "NUMBA_CACHE_DIR": str(self.kernels),
            },
        )


def without_the_clone() -> dict[str, str]:
    """Return the environment without paths to Python modules.

    With the clone among them pip finds its egg-info and installs nothing.
    """
    return {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}


def pip(*arguments: str, cwd: Path) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *arguments]
    subprocess.run(command, check=True, timeout=600, cwd=cwd, env=without_the_clone())


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Visavis from a wheel without extras: of the libraries of the environment that runs the tests
    it finds those that `pip install visavis` brings.
    """
    folder = STORE.share("installed_wheel", install_wheel, tmp_path_factory.mktemp("wheel"))
    (wheel,) = folder.glob("visavis-*.whl")
    return Installed(programs_of(folder / "environment"), wheel, folder / "kernels")


def programs_of(environment: Path) -> Path:
    """Return where an environment has its programs."""
    return environment / ("Scripts" if os.name == "nt" else "bin")


def install_wheel(folder: Path) -> Path:
    """Build the wheel and install it, once in a run."""
    folder.mkdir(parents=True, exist_ok=True)
    source = folder / "source"
    shutil.copytree(ROOT, source, ignore=LEFT_BEHIND, symlinks=True)
    people = "src/visavis/stimuli/characters/data"
    shutil.copytree(ROOT / people, source / people)
    alone = ["--no-deps", "--no-index"]
    pip("wheel", *alone, "--no-build-isolation", "-w", str(folder), str(source), cwd=folder)
    (wheel,) = folder.glob("visavis-*.whl")
    environment = folder / "environment"
    venv.create(environment, with_pip=False, symlinks=os.name != "nt")
    python = programs_of(environment) / "python"
    pip("--python", str(python), "install", "--no-compile", *alone, str(wheel), cwd=folder)
    # Folders named in a .pth file come last, and .pth files in them (the editable install of the
    # clone is one) are not read.
    where = sysconfig.get_path("purelib", vars={"base": str(environment)})
    (Path(where) / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n", "utf-8")
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dependencies"]
    absent = absent_without(brought(*asked))
    (Path(where) / "sitecustomize.py").write_text(WITHOUT_EXTRAS.format(absent=absent), "utf-8")
    lend_kernels(Path(where) / "visavis", folder / "kernels")
    shutil.rmtree(source)
    return folder


def lend_kernels(package: Path, kernels: Path) -> None:
    """Let machine code of the clone serve the installed package where their sources are the same.

    What the wheel's code compiles to is not in question here, and takes minutes. numba keeps code
    by the path of its folder, and knows a source by its time and size.
    """
    kernels.mkdir()
    for file in package.rglob("*.py"):
        own = PACKAGE / file.relative_to(package)
        assert own.read_bytes() == file.read_bytes(), f"{file} is not as in the clone"
        times = own.stat()
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
        lent, at = (kept_below(folder, one) for folder, one in ((kernels, file), (CLONES, own)))
        if os.name != "nt" and not lent.is_symlink():  # there everything is compiled
            at.mkdir(parents=True, exist_ok=True)
            lent.symlink_to(at)


def kept_below(folder: Path, source: Path) -> Path:
    """Return where numba keeps machine code of a source file."""
    return folder / UserProvidedCacheLocator.get_suitable_cache_subpath(str(source))


def in_wheel(name: str) -> str:
    """Return where a file of the repository lies in the wheel; the links of rooms are folders."""
    name = name.removeprefix("src/")
    if name in LINKS:
        return f"{name}/__init__.py"
    return name if name.startswith("visavis/") else f"visavis/{name}"


def can_draw() -> bool:
    """Tell whether pictures can be drawn on this machine."""
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError:
        return False
    return True


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new lab's folder; what one test leaves there the next one finds."""
    return tmp_path_factory.mktemp("new lab")


def output_of(done: subprocess.CompletedProcess[str]) -> str:
    assert 0 == done.returncode, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout


def test_the_wheel_holds_one_package_and_every_room_is_its_own(
    installed: Installed, tmp_path: Path
) -> None:
    with zipfile.ZipFile(installed.wheel) as wheel:
        tops = {name.partition("/")[0] for name in wheel.namelist()}
    assert {"visavis"} == {top for top in tops if not top.endswith(".dist-info")}
    program = f"import {', '.join(ROOMS)}\nprint(*[{', '.join(ROOMS)}], sep='\\n')"
    output = output_of(installed.run("python", "-c", program, cwd=tmp_path))
    assert len(ROOMS) == output.count(str(installed.programs.parent)), output
    assert str(ROOT) not in output


def test_the_version_is_that_of_the_wheel(installed: Installed, tmp_path: Path) -> None:
    expected = installed.wheel.name.split("-")[1]
    assert f"visavis {expected}\n" == output_of(installed.run("visavis", "--version", cwd=tmp_path))
    as_module = installed.run("python", "-m", "visavis", "--version", cwd=tmp_path)
    assert f"visavis {expected}\n" == output_of(as_module)
    assert f'version = "{expected}"' in (ROOT / "pyproject.toml").read_text("utf-8")


def test_the_wheel_holds_every_file_of_its_packages(installed: Installed) -> None:
    tracked = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "src/visavis", *ROOMS_AT_THE_TOP],  # noqa: S607 - git as found
        capture_output=True,
        text=True,
        check=False,
    )
    if tracked.returncode:
        pytest.skip("not a clone")
    with zipfile.ZipFile(installed.wheel) as wheel:
        assert {in_wheel(name) for name in tracked.stdout.split()} <= set(wheel.namelist())


def test_without_a_configuration_a_session_is_refused_and_the_doctor_says_what_to_do(
    installed: Installed, tmp_path: Path
) -> None:
    refused = installed.run("visavis", "run", "stare", "--participant", "1", cwd=tmp_path)
    assert 2 == refused.returncode
    assert f"no lab_config.yaml in {tmp_path} or above" in refused.stderr
    assert [] == list(tmp_path.iterdir())
    doctor = installed.run("visavis", "doctor", "--json", cwd=tmp_path)
    findings = {f["subject"]: f for f in json.loads(doctor.stdout)["findings"]}
    assert "missing" == findings["configuration"]["level"]
    assert "visavis init" in findings["configuration"]["remedy"]


def test_a_new_lab_begins_with_a_configuration_the_doctor_finds_ready(
    installed: Installed, folder: Path
) -> None:
    output_of(installed.run("visavis", "init", cwd=folder))
    report = json.loads(output_of(installed.run("visavis", "doctor", "--json", cwd=folder)))
    assert str(folder / "lab_config.yaml") == report["config"]
    assert [] == [f for f in report["findings"] if f["level"] == "missing"]


def test_a_plan_is_shown(installed: Installed, folder: Path) -> None:
    plan = output_of(installed.run("visavis", "plan", "stare", "--participant", "07", cwd=folder))
    assert "72 trials in 3 blocks" in plan


def test_a_study_is_simulated_and_analysed(installed: Installed, folder: Path) -> None:
    simulate = ["simulate", "stare", "--participants", "2", *SHORT_STARE, *ONE, "--output", "dry"]
    analyse = ["analyse", "dry/simulated/stare", *ONE]
    verbs = (" ".join(words) for words in (simulate, analyse))
    output_of(installed.run("python", "-c", IN_TURN, *verbs, cwd=folder))
    assert (folder / "dry/simulated/stare/derived/report.html").stat().st_size > 10_000


def test_a_study_file_goes_through_every_verb_beside_a_labs_own_modules(
    installed: Installed, tmp_path: Path
) -> None:
    shutil.copytree(STUDIES / "texts", tmp_path / "texts")
    shutil.copy(STUDIES / "duel.py", tmp_path / "duel.py")
    fill_lab_folder(tmp_path)
    draws = can_draw()
    verbs = [verb for verb in EVERY_VERB if draws or verb.split()[0] not in DRAWING]
    output_of(installed.run("python", "-c", IN_TURN, *verbs, cwd=tmp_path))
    assert (tmp_path / "data/simulated/duel/derived/report.html").stat().st_size > 10_000
    assert (tmp_path / "dry/simulated/duel/derived/report.html").stat().st_size > 10_000
    assert list((tmp_path / "out").rglob("*.parquet"))
    assert (tmp_path / "power").is_dir()


def test_the_demo_writes_a_report_in_an_empty_folder(installed: Installed, tmp_path: Path) -> None:
    output_of(installed.run("visavis", "demo", "--participants", "1", cwd=tmp_path))
    assert (tmp_path / "demo/simulated/stare/derived/report.html").stat().st_size > 10_000
    assert ["demo"] == [p.name for p in tmp_path.iterdir()]


def test_script_beside_a_labs_own_modules_imports_theirs_and_visavis(
    installed: Installed, tmp_path: Path
) -> None:
    fill_lab_folder(tmp_path)
    printed = output_of(installed.run("python", "script.py", cwd=tmp_path))
    assert "visavis.study.declaration visavis.analysis.gaze" in printed


@pytest.mark.skipif(os.name == "nt", reason="links of Windows need a right of their own")
def test_rooms_are_found_where_a_clone_has_text_in_the_place_of_links(tmp_path: Path) -> None:
    """What Git on Windows without the right to make links writes."""
    clone = tmp_path / "clone"
    shutil.copytree(ROOT, clone, ignore=LEFT_BEHIND, symlinks=True)
    for name in (*ROOMS_AT_THE_TOP, "lab/example_lab.yaml"):
        link = clone / "src/visavis" / name
        target = os.readlink(link)
        link.unlink()
        link.write_text(target, "utf-8")
    alone = ["--no-deps", "--no-index", "--no-build-isolation"]
    site = tmp_path / "site"
    pip("install", *alone, "--target", str(site), "-e", str(clone), cwd=tmp_path)
    program = f"""
import site, sys
sys.path.remove({str(PACKAGE.parent)!r})  # where the clone that runs this test is installed
site.addsitedir({str(site)!r})
from visavis.experiments.stare import study
from visavis.lab.config_files import EXAMPLE
print(study.__file__)
print(EXAMPLE.read_text("utf-8"))
"""
    done = subprocess.run(
        [sys.executable, "-I", "-c", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    file, _, example = output_of(done).partition("\n")
    assert str(clone / "experiments/stare/study.py") == file
    assert (ROOT / "lab_config.yaml").read_text("utf-8") == example.removesuffix("\n")

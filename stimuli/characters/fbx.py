"""Figures in FBX files, by way of Blender: it reads them and writes glTF, which is imported.

FBX is Autodesk's own format. No reader of it for Python is both free and kept up; Blender's is.
"""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from stimuli.characters.errors import CharacterError

TIMEOUT_S: Final = 300.0
_SCRIPT: Final = """
import sys
import bpy
source, made = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.fbx(filepath=source)
bpy.ops.export_scene.gltf(filepath=made, export_format="GLB", export_animations=False)
"""
_PLACES: Final = {
    "darwin": ("/Applications", "Blender*.app/Contents/MacOS/Blender"),
    "win32": ("C:/Program Files/Blender Foundation", "Blender */blender.exe"),
}
"""Where Blender's installer puts it on systems on which it is not found by its name."""
REMEDY: Final = (
    "install Blender (blender.org, or `apt install blender python3-numpy`) so that it is found as "
    "`blender`, or "
    "export the figure as .glb from the program that made it"
)


def find_blender() -> str | None:
    """Return what starts Blender: the one called `blender`, else the newest installed."""
    found = shutil.which("blender")
    if found is None and sys.platform in _PLACES:
        folder, pattern = _PLACES[sys.platform]
        found = max((str(path) for path in Path(folder).glob(pattern)), default=None)
    return found


@contextmanager
def as_glb(path: Path) -> Iterator[Path]:
    """Lay an FBX file for a while as a .glb of the same name.

    Raises:
        CharacterError: there is no Blender, or it cannot read the file.
    """
    blender = find_blender()
    if blender is None:
        raise CharacterError(f"{path}: FBX files are read by Blender, which is not here; {REMEDY}")
    with TemporaryDirectory() as folder:
        made = Path(folder) / f"{path.stem}.glb"
        command = [blender, "--background", "--factory-startup", "--python-exit-code", "1"]
        command += ["--python-expr", _SCRIPT, "--", str(path.resolve()), str(made)]
        try:
            done = subprocess.run(  # noqa: S603 - a program of the lab's own
                command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT_S
            )
        except subprocess.TimeoutExpired as e:
            raise CharacterError(
                f"{path}: Blender did not finish it in {TIMEOUT_S:g} s; open it there and export "
                "it as .glb"
            ) from e
        except OSError as e:
            raise CharacterError(f"{path}: Blender does not start ({e}); {REMEDY}") from e
        if done.returncode or not made.is_file():
            raise CharacterError(
                f"{path}: Blender cannot read it ({_reason(done.stdout + done.stderr)}); open it "
                "there, or export the figure as .glb from the program that made it"
            )
        yield made


def _reason(output: str) -> str:
    """Return the line of what Blender said that tells why."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if "Error" in line]
    return (errors or lines or ["it says nothing"])[-1]

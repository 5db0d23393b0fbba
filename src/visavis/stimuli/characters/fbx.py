"""Figures in FBX files, by way of Blender: it reads them and writes glTF, which is imported.

FBX is Autodesk's own format. No Python reader of it is both free and maintained; Blender's is.
"""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from visavis.stimuli.characters.errors import CharacterError

TIMEOUT_S: Final = 300.0
_NUMPY: Final = "numpy"
_LOST: Final = "picture not found: "
_SCRIPT: Final = f"""
import sys
from pathlib import Path, PureWindowsPath
import bpy
source, made = map(Path, sys.argv[sys.argv.index("--") + 1:])
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.fbx(filepath=str(source))

# Files name pictures where they lay on their maker's disk. Rocketbox keeps them in a folder beside
# that of the figure.
home = source.parent.parent
lying = [*home.glob("*"), *home.glob("*/*"), *source.parent.rglob("*")]
by_name = {{path.name.lower(): path for path in lying if path.is_file()}}
lost = set()
for image in bpy.data.images:
    name = PureWindowsPath(image.filepath).name
    if image.source == "FILE" and image.packed_file is None and not image.size[0]:
        if name.lower() in by_name:
            image.filepath = str(by_name[name.lower()])
        if not image.size[0]:
            lost.add(name)
for material in bpy.data.materials:
    tree = material.node_tree
    for node in list(tree.nodes) if tree else []:
        if node.type == "TEX_IMAGE" and (node.image is None or not node.image.size[0]):
            tree.nodes.remove(node)  # it would break the export
        elif node.type == "TEX_IMAGE" and node.image.depth == 32:
            # The alpha of a picture is what hides, not its red.
            for link in list(node.outputs["Color"].links):
                if link.to_socket.name == "Alpha":
                    tree.links.new(node.outputs["Alpha"], link.to_socket)
        elif node.type == "BSDF_PRINCIPLED" and not node.inputs["Metallic"].is_linked:
            # FBX knows reflection, no metal; Blender takes the one for the other.
            node.inputs["Metallic"].default_value = 0.0
for name in sorted(lost):
    print("{_LOST}" + name)
bpy.ops.export_scene.gltf(filepath=str(made), export_format="GLB", export_animations=False)
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
    """Return the path of Blender: the command `blender`, else the newest installation."""
    program = shutil.which("blender")
    if program is None and sys.platform in _PLACES:
        folder, pattern = _PLACES[sys.platform]
        program = max((str(path) for path in Path(folder).glob(pattern)), default=None)
    return program


@contextmanager
def as_glb(path: Path) -> Iterator[tuple[Path, tuple[str, ...]]]:
    """Convert an FBX file to a temporary .glb of the same name, and name its missing pictures.

    Pictures are searched by their names in the file's folder, those below it and beside it.

    Raises:
        CharacterError: there is no Blender, or it cannot read the file.
    """
    blender = find_blender()
    if blender is None:
        raise CharacterError(f"{path}: FBX files are read by Blender, which is not here; {REMEDY}")
    with TemporaryDirectory() as folder:
        glb_path = Path(folder) / f"{path.stem}.glb"
        command = [blender, "--background", "--factory-startup", "--python-exit-code", "1"]
        command += ["--python-expr", _SCRIPT, "--", str(path.resolve()), str(glb_path)]
        try:
            process = subprocess.run(  # noqa: S603 - a program of the lab's own
                command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT_S
            )
        except subprocess.TimeoutExpired as e:
            raise CharacterError(
                f"{path}: Blender did not finish it in {TIMEOUT_S:g} s; open it there and export "
                "it as .glb"
            ) from e
        except OSError as e:
            raise CharacterError(f"{path}: Blender does not start ({e}); {REMEDY}") from e
        if f"No module named '{_NUMPY}'" in process.stderr + process.stdout:
            raise CharacterError(
                f"{path}: Blender lacks {_NUMPY}, without which it writes no glTF; {REMEDY}"
            )
        if process.returncode or not glb_path.is_file():
            raise CharacterError(
                f"{path}: Blender cannot read it ({_reason(process.stdout + process.stderr)}); "
                "open it there, or export the figure as .glb from the program that made it"
            )
        output_lines = [line.strip() for line in process.stdout.splitlines()]
        missing_pictures = (
            line.removeprefix(_LOST) for line in output_lines if line.startswith(_LOST)
        )
        yield glb_path, tuple(missing_pictures)


def _reason(output: str) -> str:
    """Return the line of Blender's output that gives the reason."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    errors = [line for line in lines if "Error" in line]
    return (errors or lines or ["it says nothing"])[-1]

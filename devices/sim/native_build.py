"""Compile a simulator's C library when it is needed, once per source."""

import hashlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from visavis.lab.errors import DeviceNotFound

SOURCES = Path(__file__).parent / "native"
COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c11", "-O1", "-fPIC", "-shared", "-Wall", "-Wextra", "-Wno-cast-function-type")

INSTALL = {"linux": "apt-get install gcc", "darwin": "xcode-select --install"}
"""Commands that install a C compiler; on other systems the runtimes were never built."""
WITHOUT = (
    "rehearse with drivers that need none: simulated_headset as headset, simulated_responses for "
    "controllers, simulated_body for trackers, pupil_core for gaze"
)


def find_compiler() -> str | None:
    """Return the path of a C compiler; None when there is none."""
    return next((path for name in COMPILERS if (path := shutil.which(name))), None)


def build_library(source: str, headers: dict[str, str], library: str) -> Path:
    """Compile `native/<source>` with generated headers beside it; return the library's path.

    The result is kept in the temporary folder under the hash of everything that went in. Raises
    DeviceNotFound when there is no compiler or it refuses.
    """
    compiler = find_compiler()
    if compiler is None:
        raise DeviceNotFound("this simulator needs a C compiler", remedy=_remedy())
    code = (SOURCES / source).read_bytes()
    texts = [*FLAGS, *(f"{name}={text}" for name, text in sorted(headers.items()))]
    digest = hashlib.sha256(code + "\0".join(texts).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"visavis-native-{digest}"
    target = folder / library
    if target.exists():
        return target
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as work:
        for name, text in headers.items():
            (Path(work) / name).write_text(text)
        new_library = Path(work) / "built"
        command = [compiler, *FLAGS, f"-I{work}", str(SOURCES / source), "-o", str(new_library)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603 - our own compiler call
        if result.returncode != 0:
            raise DeviceNotFound(
                f"{compiler} refused {source}: {result.stderr.strip()[:400]}",
                remedy=_remedy(),
            )
        target.parent.mkdir(parents=True, exist_ok=True)
        new_library.replace(target)
    return target


def _remedy() -> str:
    """Return the remedy if nothing could be compiled."""
    install = INSTALL.get(sys.platform)
    return WITHOUT if install is None else f"install a current one ({install}), or {WITHOUT}"

"""Files of the product, where they lie in the repository."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "visavis"
ROOMS_AT_THE_TOP = ("experiments", "devices", "protocol", "analysis")
"""Folders at the top of the repository; links below `src/visavis` lead to them."""


def product_files(pattern: str = "*.py") -> list[Path]:
    """Return the files of the package `visavis`, each once, sorted."""
    folders = [PACKAGE, *(ROOT / room for room in ROOMS_AT_THE_TOP)]
    return sorted(f for folder in folders for f in folder.rglob(pattern) if f.is_file())


def name_in_repository(file: Path) -> str:
    """Return a file's path from the top of the repository, with slashes."""
    return file.relative_to(ROOT).as_posix()

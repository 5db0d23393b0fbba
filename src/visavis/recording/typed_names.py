"""What is typed in the present folder to name a study or a folder: every message names it so."""

import shlex
from pathlib import Path

from visavis.lab.plain_files import parse_json, read_plain

STUDY_SETTINGS = "study.json"


def typed_path(path: Path) -> str:
    """Return a file or folder as it is typed in the present folder, quoted where it must be."""
    here, path = Path.cwd().resolve(), path.resolve()
    text = f"./{path.relative_to(here).as_posix()}" if path.is_relative_to(here) else str(path)
    return shlex.quote(text)


def typed_study(study_root: Path) -> str:
    """Return the study of a folder as it is typed: its file where it has one, else its name."""
    name = study_root.resolve().name
    try:
        settings = parse_json(read_plain(study_root / STUDY_SETTINGS))
    except (OSError, ValueError):  # not begun, or damaged: then the name says most
        return name
    source = settings.get("source") if isinstance(settings, dict) else None
    return typed_path(Path(source)) if isinstance(source, str) and source else name

"""Which body somebody sees as their own, and how tall they say they are.

It is kept in the person's folder, so that a withdrawal removes it; the ledger only grows.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

from visavis.lab.errors import LedgerError
from visavis.recording.durable import make_folder
from visavis.recording.sealed import copy_path, read_sealed, write_sealed

OWN_BODY_NAME = "own_body.json"
FILE_NAMES = (OWN_BODY_NAME, copy_path(Path(OWN_BODY_NAME)).name)


@dataclass(frozen=True)
class OwnBody:
    """`body` is "female" or "male", `stature_m` with shoes, as reported; empty and None until
    asked.
    """

    body: str = ""
    stature_m: float | None = None


def read_own_body(person: Path) -> OwnBody:
    """Return the body and stature stored in a person's folder.

    Raises:
        LedgerError: the file is damaged.
    """
    path = person / OWN_BODY_NAME
    if not path.exists() and not copy_path(path).exists():
        return OwnBody()
    try:
        sealed_file = read_sealed(path)
        if not sealed_file.is_sealed:
            raise ValueError("it lost its checksum")
        content = sealed_file.content
        if content["participant"] != _label_of(person):
            raise ValueError(f"it is of {content['participant']}")
        body, stature_m = content["body"], content["stature_m"]
        if not isinstance(body, str) or not isinstance(stature_m, int | float | None):
            raise ValueError("body or stature is none")
    except (OSError, ValueError, KeyError) as error:
        raise LedgerError(
            f"{path} cannot be read ({error}); `visavis recover {person.parent}` puts its copy in "
            "its place where that is intact, or delete it and its copy: it is asked again"
        ) from error
    return OwnBody(body, stature_m)


def write_own_body(person: Path, own: OwnBody) -> None:
    """Store body and stature in a person's folder; replaces what was there."""
    make_folder(person, exist_ok=True)
    write_sealed(person / OWN_BODY_NAME, {"participant": _label_of(person), **asdict(own)})


def remove_own_body(person: Path) -> tuple[Path, ...]:
    """Remove body and stature from a person's folder; return the files that were there."""
    paths = tuple(path for name in FILE_NAMES if (path := person / name).exists())
    for path in paths:
        path.unlink()
    return paths


def _label_of(person: Path) -> str:
    return person.name.removeprefix("sub-")

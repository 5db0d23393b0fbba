"""Write the files of a new study, to begin with or derived from another, and the examples."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from visavis.lab.errors import UsageError
from visavis.study.catalogue import known_studies
from visavis.study.declaration import Study
from visavis.study.parameters import parameters_in_force

EXAMPLE: Final = Path(__file__).parent / "example"
READY: Final = Path(__file__).parent / "ready"
"""Studies that are ready to be performed, and scripts for what they record."""
LANGUAGES: Final = ("en", "de", "fr")


def new_study(name: str, folder: Path, base: Study | None = None) -> tuple[Path, ...]:
    """Write NAME.py and test_NAME.py, and without a base the texts in NAME_texts; return them.

    Raises:
        UsageError: the name is not allowed or taken, or a file exists already.
    """
    if not name.isidentifier() or not name.islower():
        raise UsageError(
            f"{name!r} cannot name a study; write small letters, digits and _, such as my_study"
        )
    if name in known_studies():
        raise UsageError(f"there is a study {name} already; choose another name")
    texts, file, test = f"{name}_texts", f"{name}.py", f"test_{name}.py"
    title = name.replace("_", " ").capitalize()
    values = {"name": name, "title": title, "texts": texts, "file": file, "test": test}
    contents = {
        file: _derived_study(name, base, folder) if base else _example("study.py.txt", values),
        test: _example("test.py.txt", values),
    }
    if base is None:
        contents |= {f"{texts}/{lang}.yaml": _read(f"{lang}.yaml") for lang in LANGUAGES}
    return write_files(folder, contents)


def write_examples(folder: Path) -> tuple[Path, ...]:
    """Write every example into a folder; return the files.

    Raises:
        UsageError: one of them is there already.
    """
    contents: dict[str, str | bytes] = {
        path.stem: path.read_text("utf-8") for path in sorted(READY.glob("*.txt"))
    }
    for path in sorted((*READY.glob("*/*.png"), *READY.glob("*/*.yaml"))):
        contents[path.relative_to(READY).as_posix()] = path.read_bytes()
    return write_files(folder, contents)


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> tuple[Path, ...]:
    """Write files below a folder, from their names and contents; return their paths.

    Raises:
        UsageError: one of them is there already.
    """
    there = [str(folder / path) for path in contents if (folder / path).exists()]
    if there:
        raise UsageError(
            f"{', '.join(there)} {'is' if len(there) == 1 else 'are'} there already and left as "
            "before; choose another name, or another --folder"
        )
    paths = []
    for name, text in contents.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        paths.append(path)
    return tuple(paths)


def _read(name: str) -> str:
    return (EXAMPLE / name).read_text(encoding="utf-8")


def _example(name: str, filled: Mapping[str, str]) -> str:
    return _read(name).format(**filled)


def _derived_study(name: str, base: Study, folder: Path) -> str:
    where = base.name if base.files.path is None else _relative(base.files.path, folder)
    in_force = parameters_in_force(base, {})
    levels = {f.name: list(f.levels) for f in base.design.factors}
    parameters = "".join(
        f"        # {key!r}: {value!r},\n" for key, value in {**levels, **in_force}.items()
    )
    limits = "".join(f"        # {r.name!r}: {r.limit!r},\n" for r in base.analysis.exclusions)
    return (
        f'"""{base.title} (study {base.name}), but for what is said here.\n\n'
        "Take the # away from a line and change its value; the values that stand here are those of "
        f"{base.name}.\n"
        '"""\n\n'
        "from visavis import derive\n\n"
        "study = derive(\n"
        f"    {where!r},\n"
        f"    {name!r},\n"
        f"    # title={base.title!r},\n"
        "    parameters={  # levels of factors among them\n"
        f"{parameters}    }},\n"
        "    exclusions={  # limits of rules; None switches a rule off\n"
        f"{limits}    }},\n"
        f"    # texts={name + '_texts'!r},  # en.yaml …, with the texts that differ\n"
        ")\n"
    ).replace("'", '"')


def _relative(path: Path, folder: Path) -> str:
    try:
        relative = Path(os.path.relpath(path, folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return str(path)
    return relative if relative.startswith("..") else f"./{relative}"

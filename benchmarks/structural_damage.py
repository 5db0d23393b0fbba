"""Remove, swap, link, copy and cut what a study is made of, and see whether it is named.

python -m benchmarks.structural_damage [--cases 2016] [--seed 1] [--json] [--keep DIR]

Four people of a short waving study are simulated, one of them in two parts, and analysed. Each
case damages a copy of the folder in one of the ways of `KINDS`, at a place drawn anew; then it is
verified as `visavis check STUDY` does, and what differs is put back. Sessions of which no file
changed since they were found intact are not read again. `silent` counts cases after which nothing
was said, `tracebacks` those that ended in an error that is none of ours.
"""

import argparse
import json
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from benchmarks.damage import SHORT, STUDY
from benchmarks.full_disk import full_disk
from visavis.cli.main import main as visavis
from visavis.lab.errors import LabError
from visavis.recording.chained import append_lines
from visavis.recording.manifest import MANIFEST_NAME, read_manifest, write_manifest
from visavis.recording.sealed import copy_path
from visavis.running.sessions.folder_check import session_problems, study_problems

LISTS = ("participants.jsonl", "sessions.jsonl")
SEALED = ("study.json",)


@dataclass(frozen=True)
class Site:
    """The study's folder, and the generator that draws where it is damaged."""

    study: Path
    rng: np.random.Generator

    def any(self, pattern: str) -> Path:
        """Return one of the paths of a pattern."""
        return self.some(pattern, 1)[0]

    def some(self, pattern: str, n: int) -> list[Path]:
        """Return different paths of a pattern."""
        paths = sorted(self.study.glob(pattern))
        return [paths[i] for i in self.rng.choice(len(paths), n, replace=False)]


Damage = Callable[[Site], object]
LEVELS = {"person": "sub-*", "session": "sub-*/ses-*", "part": "sub-*/ses-*/part-*"}


def remove(path: Path) -> None:
    """Remove a file or folder."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def swap(a: Path, b: Path) -> None:
    """Exchange two files or folders."""
    between = a.with_name(".between")
    a.rename(between)
    b.rename(a)
    between.rename(b)


def put_over(a: Path, b: Path) -> None:
    """Put a copy of the first in the place of the second."""
    remove(b)
    if a.is_dir():
        shutil.copytree(a, b)
    else:
        shutil.copyfile(a, b)


def link(path: Path, elsewhere: Path) -> None:
    """Move something away, and leave a link to it."""
    path.rename(elsewhere)
    path.symlink_to(elsewhere)


def empty(folder: Path) -> None:
    """Remove all that a folder holds."""
    for path in list(folder.iterdir()):
        remove(path)


def as_file(folder: Path) -> None:
    """Put a file in a folder's place."""
    shutil.rmtree(folder)
    folder.write_bytes(b"")


def next_name(path: Path) -> Path:
    """Return the name of a further session or part, or of a person nobody registered."""
    if path.name.startswith("sub-"):
        return path.with_name("sub-S99Z")
    kind, _, number = path.name.partition("-")
    return path.with_name(f"{kind}-{int(number) + 1:0{len(number)}d}")


def both(path: Path, change: Callable[[bytes], bytes]) -> None:
    """Change a file and its copy in the same way."""
    for one in (path, copy_path(path)):
        one.write_bytes(change(one.read_bytes()))


def lines_of(data: bytes) -> list[bytes]:
    """Return the lines of a file, each with its end."""
    return data.splitlines(keepends=True)


def without_last(data: bytes) -> bytes:
    """Return a file without its last line."""
    return b"".join(lines_of(data)[:-1])


def without_first(data: bytes) -> bytes:
    """Return a file without its first line."""
    return b"".join(lines_of(data)[1:])


def lines_exchanged(data: bytes) -> bytes:
    """Return a file with its first two lines in the other order."""
    first, second, *rest = lines_of(data)
    return b"".join([second, first, *rest])


def line_twice(data: bytes) -> bytes:
    """Return a file with its last line once more."""
    return data + lines_of(data)[-1]


def half(data: bytes) -> bytes:
    """Return the first half of a file."""
    return data[: len(data) // 2]


def nothing(data: bytes) -> bytes:
    """Return an empty file."""
    return b""


def rewrite_without_end(path: Path) -> None:
    """Write a list anew without its last two lines, chained and with its copy, as our code does."""
    records = [json.loads(line) for line in path.read_text("utf-8").splitlines()][:-2]
    _remove_both(path)
    append_lines(
        path, [{k: v for k, v in r.items() if k not in ("after", "crc32")} for r in records]
    )


def manifest_without_part(session: Path) -> None:
    """Write a manifest, with its seal and copy, that lists one part less."""
    manifest = read_manifest(session)
    write_manifest(session, replace(manifest, parts=manifest.parts[:-1]))


def at_one(pattern: str, act: Callable[[Path], object]) -> Damage:
    """Return what damages one of the paths of a pattern."""
    return lambda site: act(site.any(pattern))


def at_two(pattern: str, act: Callable[[Path, Path], object]) -> Damage:
    """Return what damages two paths of a pattern."""

    def damage(site: Site) -> None:
        a, b = site.some(pattern, 2)
        act(a, b)

    return damage


def in_file(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    """Return what changes the content of a file."""
    return lambda path: path.write_bytes(change(path.read_bytes()))


def in_both(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    """Return what changes the content of a file and of its copy."""
    return lambda path: both(path, change)


def link_away(path: Path) -> None:
    """Move something out of the study, and leave a link to it."""
    study = next(p for p in path.parents if (p / LISTS[0]).exists())
    link(path, study.parent / "away")


def copy_as_other(path: Path) -> None:
    """Copy a stream's file to the name of a stream that nobody declared."""
    shutil.copyfile(path, path.with_name("other.arrows"))


def _kinds() -> Iterator[tuple[str, Damage]]:
    for name, pattern in LEVELS.items():
        yield f"{name} removed", at_one(pattern, remove)
        yield f"{name} emptied", at_one(pattern, empty)
        yield f"{name} is a file", at_one(pattern, as_file)
        yield f"{name} is a link", at_one(pattern, link_away)
        yield f"{name} renamed", at_one(pattern, lambda path: path.rename(next_free(path)))
        yield f"{name} twice", at_one(pattern, lambda p: shutil.copytree(p, next_free(p)))
        yield f"two {name}s exchanged", at_two(pattern, swap)
        yield f"{name} put over another", at_two(pattern, put_over)
        yield f"{name} inside itself", at_one(pattern, nest)
    manifests = f"sub-*/ses-*/{MANIFEST_NAME}"
    journals = "sub-*/ses-*/part-*/events.jsonl"
    streams = "sub-*/ses-*/part-*/*.arrows"
    for name, pattern in {"stream": streams, "journal": journals, "manifest": manifests}.items():
        yield f"{name} removed", at_one(pattern, remove)
        yield f"{name} emptied", at_one(pattern, in_file(nothing))
        yield f"{name} halved", at_one(pattern, in_file(half))
        yield f"{name} of another session", at_two(pattern, put_over)
        yield f"{name} is a link", at_one(pattern, link_away)
    yield "manifest and copy removed", at_one(manifests, _remove_both)
    yield "manifest and copy emptied", at_one(manifests, in_both(nothing))
    yield "manifest and copy of another", at_two(manifests, _both_over)
    yield "manifest lists a part less", at_one("sub-*/ses-*", manifest_without_part)
    yield "last journal line cut", at_one(journals, in_file(without_last))
    yield "stream under another name", at_one(streams, copy_as_other)
    changes: dict[str, Callable[[bytes], bytes]] = {
        "emptied": nothing,
        "cut by a line": without_last,
        "without its first line": without_first,
        "with lines exchanged": lines_exchanged,
        "with a line twice": line_twice,
        "halved": half,
    }
    for name in LISTS:
        yield f"{name} and copy removed", at_one(name, _remove_both)
        for what, change in changes.items():
            yield f"{name} and copy {what}", at_one(name, in_both(change))
        yield f"{name} rewritten without its end", at_one(name, rewrite_without_end)
        yield f"{name} is a link", at_one(name, link_away)
    for name in SEALED:
        yield f"{name} and copy removed", at_one(name, _remove_both)
        yield f"{name} and copy emptied", at_one(name, in_both(nothing))
        yield f"{name} and copy halved", at_one(name, in_both(half))
    yield "exports.jsonl and copy halved", at_one("exports.jsonl", in_both(half))
    yield "derived table removed", at_one("derived/**/trials.csv", remove)
    yield "derived table halved", at_one("derived/**/trials.csv", in_file(half))


def next_free(path: Path) -> Path:
    """Return the next name that nothing has."""
    name = next_name(path)
    return next_free(name) if name.exists() else name


def nest(folder: Path) -> None:
    """Move all of a folder into a folder of its name within it, as a hand's drag may."""
    away = folder.with_name(".away")
    folder.rename(away)
    folder.mkdir()
    away.rename(folder / folder.name)


def _remove_both(path: Path) -> None:
    remove(path)
    remove(copy_path(path))


def _both_over(a: Path, b: Path) -> None:
    put_over(a, b)
    put_over(copy_path(a), copy_path(b))


KINDS: dict[str, Damage] = dict(_kinds())


@dataclass
class Outcome:
    """What came of the cases: by kind those of which nothing was said, and tracebacks."""

    cases: int = 0
    silent: dict[str, int] = field(default_factory=dict)
    tracebacks: dict[str, int] = field(default_factory=dict)


def recorded_study(root: Path) -> Path:
    """Simulate and analyse the study, one person of it in two parts; return its folder."""
    command = ["simulate", STUDY, "--participants", "4", "--seed", "1", "--processes", "1"]
    command += ["--output", str(root), *(text for setting in SHORT for text in ("--set", setting))]
    with full_disk(90, "one write"), suppress(SystemExit, LabError):
        visavis(command)
    folder = root / "simulated" / STUDY
    for again in (command, ["analyse", str(folder), "--processes", "1"]):
        try:
            visavis(again)
        except SystemExit as end:
            if end.code:
                raise
    return folder


Look = tuple[int, ...]
"""What a path looks like from outside: a change of its content or place changes this."""


def look_of(path: Path) -> Look:
    """Return what a path looks like: kind, inode, size and times; of a folder only the kind."""
    look = path.lstat()
    if stat.S_ISDIR(look.st_mode):
        return (stat.S_IFMT(look.st_mode),)
    return (look.st_mode, look.st_ino, look.st_size, look.st_mtime_ns, look.st_ctime_ns)


def looks_of(folder: Path) -> dict[Path, Look]:
    """Return what everything in a folder looks like, by path; links are not followed."""
    return {path: look_of(path) for path in sorted(folder.rglob("*"))}


class WorkingCopy:
    """A copy of a study that is damaged, checked and put back again and again."""

    def __init__(self, study: Path, root: Path) -> None:
        self.source = study
        self.study = root / study.parent.name / study.name
        shutil.copytree(study, self.study, symlinks=True)
        for path in self.study.rglob("*"):
            if path.is_file():
                path.chmod(0o600)
        self._intact: dict[Path, dict[Path, Look]] = {}
        self._looks = looks_of(self.study)
        if problems := study_problems(self.study):
            raise SystemExit(f"the study is not intact to begin with: {problems[0]}")
        self._remember_intact()

    def put_back(self) -> None:
        """Make the study what it was: remove what is new or changed, copy what is gone."""
        now = looks_of(self.study)
        changed = [path for path, look in now.items() if self._looks.get(path) != look]
        for path in changed:
            if path.is_symlink() or path.exists():
                remove(path)
        for path, look in self._looks.items():
            if path.is_symlink() or path.exists():
                continue
            if stat.S_ISDIR(look[0]):
                path.mkdir()
            else:
                shutil.copyfile(self.source / path.relative_to(self.study), path)
                path.chmod(0o600)
        away = self.study.parent / "away"
        if away.exists():
            remove(away)
        self._looks = looks_of(self.study)
        self._remember_intact()

    def is_named(self) -> bool:
        """Tell whether check says anything of the study."""
        try:
            return bool(study_problems(self.study, self._problems_of))
        except LabError:
            return True

    def _remember_intact(self) -> None:
        sessions = self.study.glob("sub-*/ses-*")
        self._intact = {session: looks_of(session) for session in sessions}

    def _problems_of(self, session: Path) -> tuple[str, ...]:
        is_as_it_was = self._intact.get(session) == looks_of(session)
        return () if is_as_it_was else session_problems(session)


def measure(study: Path, kinds: Sequence[str], seed: int, root: Path) -> Outcome:
    """Damage a study in these ways, one after the other."""
    outcome = Outcome()
    copy = WorkingCopy(study, root)
    for n, kind in enumerate(kinds):
        outcome.cases += 1
        KINDS[kind](Site(copy.study, np.random.default_rng([seed, n])))
        try:
            if not copy.is_named():
                outcome.silent[kind] = outcome.silent.get(kind, 0) + 1
        except Exception as error:  # the benchmark counts what should never come
            print(f"{kind}: {error!r}", file=sys.stderr)
            outcome.tracebacks[kind] = outcome.tracebacks.get(kind, 0) + 1
        copy.put_back()
    if problems := study_problems(copy.study):
        raise SystemExit(f"the study was not put back: {problems[0]}")
    return outcome


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; 1 if anything was silent."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=2016)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--keep", type=Path, help="keep the study here, and use it again")
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory(prefix="structural-") as temporary:
        root = options.keep or Path(temporary)
        study = root / "simulated" / STUDY
        if not (study / "exports.jsonl").exists():
            study = recorded_study(root)
        names = list(KINDS)
        kinds = [names[i % len(names)] for i in range(options.cases)]
        outcome = measure(study, kinds, options.seed, Path(temporary))
    silent, tracebacks = sum(outcome.silent.values()), sum(outcome.tracebacks.values())
    if options.json:
        counts = {"cases": outcome.cases, "kinds": len(KINDS), "silent": outcome.silent}
        print(json.dumps({**counts, "tracebacks": outcome.tracebacks}))
    else:
        counted = f"{len(KINDS)} kinds, {outcome.cases} cases"
        print(f"{counted}: {silent} silent, {tracebacks} tracebacks")
        for what, counts_of in (("silent", outcome.silent), ("traceback", outcome.tracebacks)):
            for kind, n in counts_of.items():
                print(f"{what:10} {n:5}  {kind}")
    return 1 if silent or tracebacks else 0


if __name__ == "__main__":
    sys.exit(main())

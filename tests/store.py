"""Sessions that several tests read: recorded once in a run of the suite, copied to each."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

from visavis.protocol.people.file_lock import locked


class Store:
    """A folder in which every worker of a run finds what one of them recorded."""

    def __init__(self) -> None:
        self.folder: Path | None = None
        """Where sessions are stored; without one, everybody records their own."""
        self.processor_s: Callable[[], float] = lambda: sum(os.times()[:4])
        """Tells the processor time that tests are measured with."""
        self.saved_s = 0.0
        """What this process would have spent on recording the sessions of which it got copies."""

    def copy(self, name: str, record: Callable[[Path], Path], into: Path) -> Path:
        """Return the folder that `record` makes below the one it is given, copied below `into`.

        `name` stands for everything `record` depends on but that folder: another seed, study or
        setting is another name.
        """
        if self.folder is None:
            return record(into)
        made_at = self.share(name, record, into)
        place = self.folder / name / "data"
        shutil.copytree(place, into, dirs_exist_ok=True)
        return into / made_at.relative_to(place)

    def share(self, name: str, record: Callable[[Path], Path], alone: Path) -> Path:
        """Return the folder that `record` makes once in a run; nobody changes what lies there.

        Without a store it is made below `alone`.
        """
        if self.folder is None:
            return record(alone)
        place, made = self.folder / name / "data", self.folder / name / "made"
        begin_s = self.processor_s() + self.saved_s  # what it copies is of its cost, too
        with locked(self.folder / f"{name}.lock"):
            if not made.exists():
                # What a test that was stopped left is no whole recording.
                shutil.rmtree(place, ignore_errors=True)
                made_at = record(place).relative_to(place)
                took_s = self.processor_s() + self.saved_s - begin_s
                written = made.with_suffix(".new")  # whole or not at all, whoever is killed
                written.write_text(f"{took_s:.2f}\n{made_at.as_posix()}", "utf-8")
                written.replace(made)
            else:
                self.saved_s += float(made.read_text("utf-8").partition("\n")[0])
        return place / made.read_text("utf-8").partition("\n")[2]

    def cache(self, name: str, alone: Path) -> Path:
        """Return a folder to which all tests of a run add, as programs add to a cache.

        Without a store it is below `alone`.
        """
        place = (alone if self.folder is None else self.folder) / name
        place.mkdir(parents=True, exist_ok=True)
        return place


STORE = Store()

"""Write the examples: ready studies, and scripts for what they record."""

from pathlib import Path
from typing import Final

from visavis.running.new_study import written

READY: Final = Path(__file__).parent / "ready"


def write_examples(folder: Path) -> tuple[Path, ...]:
    """Write every example into a folder; return the files.

    Raises:
        UsageError: one of them is there already.
    """
    made = {path.stem: path.read_text("utf-8") for path in sorted(READY.glob("*.txt"))}
    return written(folder, made)

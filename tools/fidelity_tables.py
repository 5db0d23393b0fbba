"""Write what each study's source says, beside what the study does, into the study's README.

`python -m tools.fidelity_tables` writes the section of all studies that come with Visavis and have
a source; a test holds the READMEs to the code.
"""

from pathlib import Path
from typing import Final

from visavis.results.fidelity import fidelity_markdown, fidelity_rows
from visavis.results.opened_study import find_study
from visavis.study.catalogue import SHIPPED_STUDIES

ROOT: Final = Path(__file__).parents[1]
HEADING: Final = "## Beside the source"
"""The last one of a README."""


def section_of(name: str) -> str:
    """Return the section of a study's README, or "" where it has no source."""
    opened_study = find_study(name)
    rows = fidelity_rows(opened_study.experiment({}))
    if not rows:
        return ""
    return (
        f"{HEADING}\n\n"
        "Made by `python -m tools.fidelity_tables` from what the study declares; "
        f"`visavis fidelity {name}` prints it.\n\n{fidelity_markdown(rows)}"
    )


def readme_of(name: str) -> Path:
    """Return where a study's README lies."""
    return ROOT / "experiments" / name / "README.md"


def main() -> None:
    """Write the sections."""
    for name in SHIPPED_STUDIES:
        section, readme = section_of(name), readme_of(name)
        if section:
            before, _, _ = readme.read_text(encoding="utf-8").partition(f"{HEADING}\n")
            readme.write_text(before + section, encoding="utf-8")


if __name__ == "__main__":
    main()

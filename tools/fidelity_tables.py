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
"""The last one of a README; studies of one folder have one each, after the other."""


def section_of(name: str) -> str:
    """Return the section of a study's README, or "" where it has no source."""
    opened_study = find_study(name)
    rows = fidelity_rows(opened_study.experiment({}))
    if not rows:
        return ""
    of_which = "" if readme_of(name).parent.name == name else f": {name}"
    return (
        f"{HEADING}{of_which}\n\n"
        "Made by `python -m tools.fidelity_tables` from what the study declares; "
        f"`visavis fidelity {name}` prints it.\n\n{fidelity_markdown(rows)}"
    )


def readme_of(name: str) -> Path:
    """Return where a study's README lies: in its folder, which another may share."""
    return ROOT / "experiments" / find_study(name).study.files.folder.name / "README.md"


def main() -> None:
    """Write the sections."""
    sections: dict[Path, list[str]] = {}
    for name in SHIPPED_STUDIES:
        sections.setdefault(readme_of(name), []).append(section_of(name))
    for readme, some in sections.items():
        before, _, _ = readme.read_text(encoding="utf-8").partition(f"{HEADING}\n")
        readme.write_text(before + "\n".join(filter(None, some)), encoding="utf-8")


if __name__ == "__main__":
    main()

"""What a data set says about itself: authors, place and licence."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class DatasetAbout:
    """What a data set says about itself; empty texts and lists are left out.

    `description` says what participants did, in a sentence; `methods` are paragraphs for the
    README.
    """

    description: str = ""
    methods: tuple[str, ...] = ()
    authors: tuple[str, ...] = ()
    licence: str = ""
    how_to_acknowledge: str = ""
    funding: tuple[str, ...] = ()
    ethics_approvals: tuple[str, ...] = ()
    references: tuple[str, ...] = ()
    institution: str = ""
    institution_address: str = ""
    department: str = ""

    def description_fields(self) -> dict[str, Any]:
        """Return the fields of `dataset_description.json`."""
        fields: dict[str, Any] = {
            "License": self.licence,
            "Authors": list(self.authors),
            "HowToAcknowledge": self.how_to_acknowledge,
            "Funding": list(self.funding),
            "EthicsApprovals": list(self.ethics_approvals),
            "ReferencesAndLinks": list(self.references),
        }
        return {name: value for name, value in fields.items() if value}

    def place_fields(self) -> dict[str, str]:
        """Return the fields about the place, which every recording gets."""
        fields = {
            "InstitutionName": self.institution,
            "InstitutionAddress": self.institution_address,
            "InstitutionalDepartmentName": self.department,
        }
        return {name: value for name, value in fields.items() if value}

    def readme(self, name: str, *, is_simulated: bool, streams: Mapping[str, str]) -> str:
        """Return the README: what it is, how it was made, what lies where."""
        kind = (
            "Simulated participants and devices; no person was measured."
            if is_simulated
            else "Recorded with people."
        )
        file_lines = "\n".join(f"- `{pattern}`: {what}" for pattern, what in streams.items())
        parts = [
            f"# {name}",
            self.description or "A study in virtual reality.",
            kind,
            *(("## Methods", *self.methods) if self.methods else ()),
            "## Files",
            "Every session is a folder, every uninterrupted part of it a run. Times count in "
            "seconds from the first sample or event of the run.",
            file_lines,
            "Invalid samples are `n/a`, never zero. Text that a spreadsheet would run begins with "
            "an apostrophe. Written by Visavis from session folders, which hold everything else: "
            "what was shown in every frame, the plan, the seeds and the versions.",
        ]
        return "\n\n".join(parts) + "\n"

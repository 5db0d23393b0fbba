"""What people are told before they enter a headset by a page, in the study's language."""

import hashlib
from dataclasses import dataclass
from typing import Final

from visavis.study.texts import Texts

SECTION: Final = "headset"
"""The texts' section whose entries are the lines, in the order of reading."""


@dataclass(frozen=True)
class HeadsetInformation:
    """The lines that the page shows beside the button that enters VR."""

    lines: tuple[str, ...]

    @property
    def version(self) -> str:
        """The beginning of the SHA-256 of all lines: another text is another version."""
        return hashlib.sha256("\n".join(self.lines).encode()).hexdigest()[:12]


def headset_information(texts: Texts) -> HeadsetInformation:
    """Return what people are told about taking part in a headset.

    A study's own texts may replace a line (`headset.age` with its own minimum age) or add some.
    """
    return HeadsetInformation(tuple(texts.get(f"{SECTION}.{n}") for n in texts.below(SECTION)))

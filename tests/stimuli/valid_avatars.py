"""VALID avatars (Do et al. 2023) to test with, where a machine has them; they are not shipped."""

import os
from pathlib import Path

import pytest

_FOLDER = os.environ.get("VISAVIS_AVATARS")

needs_avatars = pytest.mark.skipif(
    _FOLDER is None, reason="set VISAVIS_AVATARS to a folder of VALID avatars (.glb) to test them"
)


def avatar_files() -> list[Path]:
    """Return the avatars' files in order of name."""
    assert _FOLDER is not None
    return sorted(Path(_FOLDER).glob("*.glb"))

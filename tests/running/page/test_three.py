"""The library that draws figures on pages: the file that was looked at, with its licence."""

import hashlib

from visavis.running.page.server import LIVE_FILES, SITE

THREE = SITE / "three"
SHA256 = "3c3618e1a1eec4bc31222013b12e877b1b7e4d286016da6a280a48ef82fea330"
MAX_BYTES = 600_000


def test_the_library_is_the_one_that_was_built_and_looked_at() -> None:
    data = (THREE / "three.js").read_bytes()
    assert hashlib.sha256(data).hexdigest() == SHA256
    assert len(data) <= MAX_BYTES


def test_its_licence_lies_beside_it_and_is_named_in_it() -> None:
    assert "The MIT License" in (THREE / "LICENSE.txt").read_text("utf-8")
    assert "SPDX-License-Identifier: MIT" in (THREE / "three.js").read_text("utf-8")


def test_every_file_of_live_figures_is_there() -> None:
    assert all((SITE / name).is_file() for name in LIVE_FILES.values())

"""The pictures of the documentation: all known to what makes them, small, and shown somewhere."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tools.pictures import FOLDER, MAX_BYTES, PICTURES, ByHand, Workshop, make, save
from visavis.lab.errors import UsageError

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("experiments/*/README.md")]
SHOWN = re.compile(r"!\[[^\]]+\]\([^)]*pictures/([^)]+)\)")
"""A picture with words for those who do not see it."""


FILMS = frozenset({"gestures_heard.webm"})
"""Films stand beside pictures; a page links to them, and a reader asks for one."""
MAX_FILM_BYTES = 400_000


def test_the_command_knows_every_picture() -> None:
    assert sorted({*PICTURES, *FILMS}) == sorted(path.name for path in FOLDER.iterdir())


def test_every_picture_is_small_enough_for_a_page() -> None:
    for path in FOLDER.iterdir():
        limit = MAX_FILM_BYTES if path.name in FILMS else MAX_BYTES
        assert path.stat().st_size <= limit, path.name


def test_every_picture_is_shown_on_some_page() -> None:
    shown = {name for page in PAGES for name in SHOWN.findall(page.read_text("utf-8"))}
    assert sorted(PICTURES) == sorted(shown)


def test_the_first_screen_of_the_readme_shows_what_visavis_is() -> None:
    first = (ROOT / "README.md").read_text("utf-8").partition("## See it work")[0]
    assert ["stare_eyes.jpg", "desk.jpg", "gaze_map.jpg", "report.jpg"] == SHOWN.findall(first)


def test_commands_of_pictures_are_commands() -> None:
    from tests.cli.test_commands_in_docs import problem_of

    commands = [
        command.format(file="new.png")
        for recipe in PICTURES.values()
        for command in getattr(recipe, "commands", ())
    ]
    assert len(commands) > 5
    assert {} == {c: said for c in commands if (said := problem_of(c.split()))}


def test_a_picture_that_stays_too_large_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (900, 900, 3), np.uint8)
    with pytest.raises(UsageError, match=r"large\.jpg has \d+ bytes"):
        save(Image.fromarray(noise), tmp_path / "large.jpg")
    save(Image.fromarray(noise[:200, :200]), tmp_path / "small.jpg")
    assert ["small.jpg"] == [path.name for path in tmp_path.iterdir()]


def test_what_is_made_by_hand_says_how_and_is_left_as_it_is(tmp_path: Path) -> None:
    by_hand = [name for name, recipe in PICTURES.items() if isinstance(recipe, ByHand)]
    assert all(make(name, Workshop(tmp_path), tmp_path) is None for name in by_hand)
    assert [] == list(tmp_path.iterdir())

"""Where a lab's configuration lies, and the example that comes with Visavis.

The example is written by `visavis init` and stands in for a configuration where a command only
simulates. No other file of the installed package is ever used as a lab's configuration.
"""

from pathlib import Path

CONFIG_NAME = "lab_config.yaml"
MAX_LINK_BYTES = 100
"""Longer than the text that stands for a link, shorter than a configuration."""


def follow_text_link(path: Path) -> Path:
    """Return a file, or the one it leads to where Git wrote a link as a text file (Windows)."""
    if path.stat().st_size > MAX_LINK_BYTES:
        return path
    return path.parent / path.read_text("utf-8").strip()


EXAMPLE = follow_text_link(Path(__file__).with_name("example_lab.yaml"))
"""One lab in which every device is simulated; in the repository a link to lab_config.yaml."""
SCREEN_EXAMPLE = Path(__file__).with_name("example_screen_lab.yaml")
"""The same with a monitor in the place of a headset."""


def find_config(folder: Path) -> Path | None:
    """Return the configuration in a folder, or else the nearest one above it; None without any."""
    here = folder.absolute()
    places = (at / CONFIG_NAME for at in (here, *here.parents))
    return next((place for place in places if place.is_file()), None)

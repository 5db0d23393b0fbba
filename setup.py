"""Find the packages of Visavis; everything else about it stands in pyproject.toml.

`src/visavis/devices` and three more are links to folders at the top of the repository
(docs/decisions/0019-one-import-name.md). Git on Windows without the right to make links writes a
small text file in the place of each; then the installation maps these rooms to their folders.
"""

from pathlib import Path

from setuptools import find_namespace_packages, setup

ROOMS = ("experiments", "devices", "protocol", "analysis")
SOURCE = Path(__file__).parent / "src" / "visavis"

missing = [room for room in ROOMS if not (SOURCE / room).is_dir()]
setup(
    packages=find_namespace_packages("src", include=["visavis*"])
    + [
        f"visavis.{package}"
        for room in missing
        for package in find_namespace_packages(include=[room, f"{room}.*"])
    ],
    package_dir={"": "src", **{f"visavis.{room}": room for room in missing}},
)

"""A table with a cell that no reader of CSV takes is refused with its line, whatever it is for."""

from collections.abc import Callable
from pathlib import Path

import pytest

from visavis.lab.errors import DataError
from visavis.recording.annotations import read_annotations
from visavis.stimuli.area_files import read_areas
from visavis.stimuli.motion.speaking.gesture_script import read_script
from visavis.study.items import Items, read_items

READERS: dict[str, Callable[[Path], object]] = {
    "annotations": read_annotations,
    "areas": lambda path: read_areas(path, (100, 100)),
    "gestures": read_script,
    "items": lambda path: read_items(Items(path.name), path.parent, ()),
}


@pytest.mark.parametrize("name", READERS)
def test_an_endless_cell_is_refused_with_its_line(name: str, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    table.write_text("area,x,y\na,1," + "9" * 200_000, "utf-8")
    with pytest.raises(DataError, match=r"table\.csv, line 2: .*repair the line"):
        READERS[name](table)

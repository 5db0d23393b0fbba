"""Readers of others' recordings wait for no pipe, and unpack no attributes from a header."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from visavis.analysis.gaze.eyelink_asc import _lines
from visavis.analysis.gaze.text_table import read_text_table
from visavis.analysis.xdf_times import _DamageError, _header
from visavis.lab.errors import DataError


@pytest.mark.parametrize("read", [_lines, partial(read_text_table, delimiter=",")])
def test_a_pipe_is_refused(tmp_path: Path, read: Callable[[Path], object]) -> None:
    os.mkfifo(tmp_path / "gaze.csv")
    with pytest.raises(DataError, match="not a regular file"):
        read(tmp_path / "gaze.csv")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_header_that_declares_attributes_is_damage(encoding: str) -> None:
    text = '<!DOCTYPE r [<!ATTLIST a b CDATA "xxxx">]><r><a/></r>'
    with pytest.raises(_DamageError, match="DOCTYPE"):
        _header(text.encode(encoding))

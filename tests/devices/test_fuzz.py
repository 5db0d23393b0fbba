"""Damaged inputs are refused in words: every codec, every reader of a file, a few hundred times.

`python -m benchmarks.fuzz` does the same a million times.
"""

from pathlib import Path

import pytest

import devices.drivers
from benchmarks.fuzz.__main__ import fuzz
from benchmarks.fuzz.codecs import codecs
from benchmarks.fuzz.files import files

DRIVERS = Path(devices.drivers.__file__).parent


def test_every_codec_is_fuzzed() -> None:
    modules = {path.relative_to(DRIVERS).with_suffix("") for path in DRIVERS.rglob("*codec.py")}
    fuzzed = {target.name.split()[0] for target in codecs()}
    assert {".".join(module.parts) for module in modules} <= fuzzed


@pytest.mark.parametrize("target", list(codecs()), ids=lambda target: target.name)
def test_no_damaged_bytes_of_a_wire_raise(target) -> None:
    outcome = fuzz(target, 200, float("inf"), seed=7)
    assert (200, {}) == (outcome.inputs, outcome.where)


@pytest.mark.slow
def test_every_reader_refuses_damaged_files_in_words(tmp_path: Path) -> None:
    found = {
        target.name: fuzz(target, 40, float("inf"), seed=7).where for target in files(tmp_path)
    }
    assert {} == {name: where for name, where in found.items() if where}
    assert len(found) > 20

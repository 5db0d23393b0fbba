"""Damaged inputs are refused in words: every codec, every reader of a file, a few hundred times.

`python -m benchmarks.fuzz` does the same a million times.
"""

import struct
from dataclasses import replace
from pathlib import Path

import pytest

import visavis.devices.drivers
from benchmarks.fuzz.__main__ import fuzz, is_passed, read_whole, row, tallied, tally
from benchmarks.fuzz.codecs import codecs, gaze_is_sound, only_said_by
from benchmarks.fuzz.files import files
from benchmarks.fuzz.target import Target, may_pass
from visavis.devices.drivers.streaming.gaze_rays import Sample
from visavis.lab.errors import DataError

DRIVERS = Path(visavis.devices.drivers.__file__).parent
DEVICES = DRIVERS.parent


BUTTONS = {"buttons.xid", "buttons.codes", "buttons.hid_reports", "buttons.keyboard"}
"""Boxes whose drivers read their few bytes themselves."""


def test_every_codec_is_fuzzed() -> None:
    modules = [
        path.relative_to(folder).with_suffix("")
        for folder in (DRIVERS, DEVICES)
        for path in folder.rglob("*codec.py")
        if folder == DRIVERS or DRIVERS not in path.parents
    ]
    fuzzed = {target.name.split()[0] for target in codecs()}
    assert {".".join(module.parts) for module in modules} | BUTTONS <= fuzzed


def test_a_result_that_contradicts_its_format_is_counted() -> None:
    halved = struct.pack(
        "<6f?Bf3f?f3f?f", *(0.5,) * 6, True, 3, 1.0, *(0.5,) * 3, True, 4.0, *(0.5,) * 3, True, 4.0
    )
    target = Target("half a ray", (b"x",), lambda data: Sample(0, None, halved), (), gaze_is_sound)
    assert fuzz(target, 50, float("inf"), 1).wrong == 50
    sent = Target("nobody's frame", (b"x",), lambda data: [b"y"], (), only_said_by((b"x",), list))
    assert fuzz(sent, 50, float("inf"), 1).wrong == 50


@pytest.mark.parametrize("target", list(codecs()), ids=lambda target: target.name)
def test_no_damaged_bytes_of_a_wire_raise(target) -> None:
    outcome = fuzz(target, 200, float("inf"), seed=7)
    assert (200, 0, {}) == (outcome.inputs, outcome.wrong, outcome.where)


def test_values_changed_behind_a_checksum_reach_what_reads_them(tmp_path: Path) -> None:
    sealed = [target for target in files(tmp_path) if "sealed again" in target.name]
    accepted = {t.name: 100 - fuzz(t, 100, float("inf"), seed=3).refused for t in sealed}
    assert len(accepted) >= 8
    assert {} == {name: n for name, n in accepted.items() if n == 0}


def test_a_run_goes_on_with_other_inputs_where_a_tally_stopped(tmp_path: Path) -> None:
    given: list[bytes] = []
    target = Target("any", (b"whole" * 9,), given.append)
    fuzz(target, 30, float("inf"), 1)
    fuzz(target, 30, float("inf"), 1, begun=30)
    assert given[:30] != given[30:]
    at = tmp_path / "tally.json"
    assert {} == tallied(at, 1)
    tally(at, 1, {"any": {"inputs": 30}})
    tally(at, 2, {"any": {"inputs": 7}})
    assert {"any": {"inputs": 30}} == tallied(at, 1)


def test_every_reader_refuses_damaged_files_in_words(tmp_path: Path) -> None:
    found = {
        target.name: fuzz(target, 40, float("inf"), seed=7).where for target in files(tmp_path)
    }
    assert {} == {name: where for name, where in found.items() if where}
    assert len(found) > 20


def test_a_checksum_lets_pass_what_its_width_says_and_no_more() -> None:
    """One of 2ⁿ damaged frames, and above it what one run of a thousand has by chance."""
    assert 0 == may_pass(0, 1_000_000)
    assert 0 == may_pass(16, 60)
    assert 29 == may_pass(16, 1_000_000)
    assert 0 == may_pass(32, 1_000_000)
    counts = {"inputs": 1_000_000, "refused": 0, "wrong": 29, "tracebacks": 0, "hangs": 0}
    assert is_passed(counts, 16)
    assert not is_passed({**counts, "wrong": 30}, 16)
    assert not is_passed({**counts, "wrong": 1}, 0)
    assert not is_passed({**counts, "wrong": 0, "hangs": 1}, 16)
    assert "29 wrong (may 29)" in row("armband.codec", counts, 16)


def test_a_codec_whose_checksum_is_not_looked_at_fails_its_allowance() -> None:
    band = next(target for target in codecs() if target.name == "armband.codec")
    unchecked = replace(band, read=lambda data: [data])
    assert fuzz(unchecked, 200, float("inf"), 1).wrong > may_pass(band.checksum_bits, 200)


def test_a_target_that_refuses_its_whole_sample_is_no_target() -> None:
    def refuse(data: bytes) -> object:
        raise DataError("not mine")

    with pytest.raises(ValueError, match="any refuses a whole sample: not mine"):
        read_whole(Target("any", (b"x",), refuse, (DataError,)))
    with pytest.raises(ValueError, match="called wrong"):
        read_whole(Target("any", (b"x",), list, is_sound=lambda found: False))


def test_every_target_takes_its_whole_samples(tmp_path: Path) -> None:
    targets = (*codecs(), *files(tmp_path))
    assert len(targets) > 80
    for target in targets:
        read_whole(target)

"""Units are those of UCUM: held against its own table of examples and ucumvert's parser."""

import csv
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from visavis.lab.errors import DataError
from visavis.lab.schema import Field
from visavis.lab.ucum import METRIC, OTHER, PREFIXES, code_of, is_ucum, nearest, require_ucum

ucumvert = pytest.importorskip("ucumvert", reason="pip install ucumvert")
VENDOR = Path(ucumvert.__file__).parent / "vendor"
SPACE = "{http://unitsofmeasure.org/ucum-essence}"


@pytest.fixture(scope="module")
def parser():
    return ucumvert.get_ucum_parser()


def of_ucum(parser, text):
    try:
        parser.parse(text)
    except Exception:  # whatever the peer says, it does not take it
        return False
    return True


def test_codes_are_those_of_the_essence():
    root = ET.parse(VENDOR / "ucum-essence.xml").getroot()  # noqa: S314 - of an installed package
    prefixes = [e.get("Code") for e in root.iter(f"{SPACE}prefix")]
    units = {e.get("Code"): e.get("isMetric") == "yes" for e in root.iter(f"{SPACE}unit")}
    base = [e.get("Code") for e in root.iter(f"{SPACE}base-unit")]
    assert prefixes == PREFIXES
    assert [*base, *(code for code, metric in units.items() if metric)] == METRIC
    assert set(OTHER) <= {code for code, metric in units.items() if not metric}


def test_official_examples_are_taken_but_for_customary_units():
    with (VENDOR / "ucum_examples.tsv").open(encoding="utf-8") as file:
        codes = [row["UCUM_CODE"] for row in csv.DictReader(file, delimiter="\t")]
    refused = [code for code in codes if not is_ucum(code)]
    assert len(codes) > 800
    assert len(refused) < 0.08 * len(codes), refused
    left_out = [code for code in refused if "[" not in code]
    assert left_out == ["Torr"]  # which the essence does not have either


ATOMS = st.sampled_from([*METRIC, *OTHER])
PIECES = st.one_of(
    ATOMS,
    st.sampled_from([p + u for p in PREFIXES for u in METRIC]),
    st.sampled_from(
        ["{beats}", "{}", "/", ".", "(", ")", "2", "-1", "+3", "0", "10", " ", "µ", "x"]
    ),
)


@given(st.lists(PIECES, min_size=1, max_size=6).map("".join))
@settings(max_examples=400, deadline=None)
def test_verdict_is_that_of_ucumvert(parser, text):
    assert of_ucum(parser, text) == is_ucum(text)


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("microvolts", "uV"),
        ("µV", "uV"),
        ("HZ", "Hz"),
        ("degC", "Cel"),
        ("°C", "Cel"),
        ("bpm", "/min"),
        ("m/s^2", "m/s2"),
        ("m/s²", "m/s2"),
        ("kOhms", "kOhm"),
        ("uv", "uV"),
        ("mmHg", "mm[Hg]"),
        ("microsiemens", "uS"),
    ],
)
def test_what_people_write_is_near_to_what_they_mean(written, meant):
    assert nearest(written) == meant
    assert not is_ucum(written)


def test_units_that_nobody_knows_have_no_code():
    assert code_of("furlongs") == ""
    assert code_of("") == ""


def test_a_column_of_a_driver_is_refused_with_the_nearest_unit():
    with pytest.raises(DataError, match=r"'rate' has unit 'bpm'.* did you mean '/min'"):
        Field("rate", "f4", "bpm")
    with pytest.raises(DataError, match=r"none of UCUM.* uV, Cel"):
        require_ucum("qqqq", "it")


def test_flags_have_no_unit():
    assert Field("valid", "?", "").unit == ""

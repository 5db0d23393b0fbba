"""docs/devices.md says of every driver what its description says."""

import re
from dataclasses import astuple
from itertools import groupby
from pathlib import Path

from visavis.devices.registry import built_in, driver_wiring

PAGE = Path(__file__).parents[2] / "docs" / "devices.md"


def told(spec):
    if driver_wiring(spec.name).real is None:
        return "exist in simulation only", "–", "–"
    return spec.claims.stands_for, spec.claims.checked, spec.claims.unproven


def test_the_table_of_drivers_follows_their_descriptions():
    specs = sorted(built_in().values(), key=told)
    described = {
        told(group[0]): {spec.name for spec in group}
        for group in (list(g) for _, g in groupby(specs, key=told))
    }
    rows = re.findall(r"^\| (`.*) \| (.*) \| (.*) \| (.*) \|$", PAGE.read_text("utf-8"), re.M)
    table = {
        (stands_for, checked, unproven): set(re.findall(r"`(\w+)`", names))
        for names, stands_for, checked, unproven in rows
        if set(re.findall(r"`(\w+)`", names)) <= set(built_in())
    }
    assert described == table


def test_every_driver_says_what_it_was_checked_against_and_what_its_unit_must_settle():
    untold = [
        spec.name
        for spec in built_in().values()
        if driver_wiring(spec.name).real is not None and not all(astuple(spec.claims))
    ]
    assert untold == []


SOURCES = ("measured", "told by", "assumed", "not known")
OFFSETS = ("picture_delay_ms", "sound_delay_ms", "vibration_delay_ms", "head_beyond_ms")


def test_every_figure_of_time_names_where_it_comes_from():
    page = (PAGE.parent / "synchronisation.md").read_text("utf-8")
    section = page.partition("## Where each figure of time comes from")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (.*) \| .* \| (.*) \|$", section, re.M)[2:]
    assert [] == [figure for figure, source in rows if not source.startswith(SOURCES)]
    options = {
        name
        for spec in built_in().values()
        for name in spec.options.model_fields
        if re.search(r"(delay|latency|ahead|rise)_ms$", name)
    }
    assert options | set(OFFSETS) <= {figure.strip("`") for figure, _ in rows}

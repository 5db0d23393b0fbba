"""Tables are written in one place, where formulas are neutralised."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
ALLOWED = {
    "recording/csv_file.py",
    "recording/bids.py",
    "recording/number_table.py",
    "protocol/withdrawal.py",
}
"""The place; BIDS tables, which call it; tables of numbers; rows taken out of a CSV."""
PACKAGES = "analysis cli devices experiments lab protocol recording visavis".split()


def test_no_other_module_writes_csv() -> None:
    writers = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if re.search(r"\.to_csv\(|csv\.writer|DictWriter", path.read_text(encoding="utf-8"))
    }
    assert ALLOWED == writers

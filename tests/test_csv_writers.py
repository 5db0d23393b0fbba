"""Tables are written in one place, where formulas are neutralised."""

import re

from tests.product_files import name_in_repository, product_files

ALLOWED = {
    "src/visavis/recording/csv_file.py",
    "src/visavis/recording/bids.py",
    "src/visavis/recording/number_table.py",
    "protocol/people/withdrawal.py",
}
"""The place; BIDS tables, which call it; tables of numbers; rows taken out of a CSV."""


def test_no_other_module_writes_csv() -> None:
    writers = {
        name_in_repository(path)
        for path in product_files()
        if re.search(r"\.to_csv\(|csv\.writer|DictWriter", path.read_text(encoding="utf-8"))
    }
    assert ALLOWED == writers

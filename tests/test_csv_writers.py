"""Tables are written in one place, where formulas are neutralised."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd

from tests.product_files import name_in_repository, product_files
from visavis.recording.csv_file import write_csv

ALLOWED = {
    "src/visavis/recording/csv_file.py",
    "src/visavis/recording/bids.py",
    "src/visavis/recording/number_table.py",
    "protocol/people/withdrawal.py",
    "src/visavis/stimuli/motion/speaking/speech.py",
}
"""The place; BIDS tables, which call it; tables of numbers; rows taken out of a CSV; times of
words, which are read back word for word."""


def test_no_other_module_writes_csv() -> None:
    writers = {
        name_in_repository(path)
        for path in product_files()
        if re.search(r"\.to_csv\(|csv\.writer|DictWriter", path.read_text(encoding="utf-8"))
    }
    assert ALLOWED == writers


def test_truths_are_read_as_truths_by_pandas_and_r(tmp_path: Path) -> None:
    table = pd.DataFrame(
        {
            "plain": [True, False],
            "missing": pd.array([True, None], dtype="boolean"),
            "objects": pd.Series([None, False], dtype=object),
            "words": ["True", "no"],
        }
    )
    path = tmp_path / "truths.csv"
    write_csv(table, path)
    text = "plain,missing,objects,words\nTRUE,TRUE,,True\nFALSE,,FALSE,no\n"
    assert text == path.read_text("utf-8")
    back = pd.read_csv(path)
    assert [True, False] == back["plain"].tolist()
    assert True is back["missing"][0]
    r = shutil.which("Rscript")
    if r is not None:
        code = f'cat(sapply(read.csv("{path}"), is.logical))'
        said = subprocess.run([r, "-e", code], capture_output=True, text=True, check=True)
        assert "TRUE TRUE TRUE FALSE" == said.stdout

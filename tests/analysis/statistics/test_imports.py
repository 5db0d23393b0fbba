"""The core of the package stays light."""

import subprocess
import sys

CODE = """
import sys
import numpy as np
from visavis.analysis import statistics
frame = {
    "s": np.repeat(np.arange(6), 4), "a": np.tile([0, 0, 1, 1], 6), "b": np.tile([0, 1], 12),
    "y": np.random.default_rng(1).normal(size=24),
}
table = statistics.art_anova(frame, "y", subject="s", within=("a", "b"))
statistics.art_contrasts(table, "a:b")
statistics.rm_anova(frame, "y", subject="s", within=("a", "b"))
statistics.wilcoxon_signed_rank(frame["y"][::2], frame["y"][1::2])
heavy = ("pandas", "statsmodels", "rpy2", "matplotlib", "scipy.stats", "numba", "pyarrow")
print([name for name in heavy if name in sys.modules])
"""


def test_core_imports_neither_pandas_nor_statsmodels_nor_r() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert "[]" == done.stdout.strip(), done.stderr

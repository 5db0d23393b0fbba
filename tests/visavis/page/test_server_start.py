"""A server that was killed is there again before people give up: it loads no more than it needs."""

import subprocess
import sys

CODE = """
import sys
from visavis.catalogue import find_study
import visavis.page.perform
import visavis.page.reception
heavy = ("scipy.stats", "scipy.signal", "scipy.optimize", "scipy.interpolate", "statsmodels")
print([name for name in heavy if name in sys.modules])
"""


def test_serving_a_study_loads_no_part_of_scipy_that_only_analyses_need() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=False)
    assert "[]" == done.stdout.strip(), done.stderr

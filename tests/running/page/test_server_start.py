"""A server that was killed is there again before people give up: it loads no more than it needs."""

import subprocess
import sys
from pathlib import Path

STUDY = """
from visavis import Factor, Film, Rating, Scene, Study

study = Study("lively", factors=[Factor("motion", ["idle", "wave"])], on="browser", uses=(),
              calibrate=False)


@study.trial
def trial(t):
    yield t.watch(Film(Scene("person", motion=t.motion), 2.0), Rating("lively", 1, 5))
"""
CODE = """
import sys
import visavis.cli.commands.serving
import visavis.running.page.reception
from visavis.results.opened_study import find_study
films = find_study(sys.argv[1]).experiment({}).films
heavy = (
    "matplotlib", "av", "moderngl", "scipy.stats", "scipy.signal", "scipy.optimize",
    "scipy.interpolate", "scipy.spatial", "statsmodels",
)
print(len(films), [name for name in heavy if name in sys.modules])
"""


def test_serving_a_study_loads_nothing_that_only_figures_and_analyses_need(tmp_path: Path) -> None:
    (tmp_path / "lively.py").write_text(STUDY, encoding="utf-8")
    asked = [sys.executable, "-c", CODE, str(tmp_path / "lively.py")]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert "2 []" == done.stdout.strip(), done.stderr

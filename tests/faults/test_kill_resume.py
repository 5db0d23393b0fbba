import json
import subprocess
import sys
from pathlib import Path

import pytest

KILLS = 50


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_sessions_killed_fifty_times_lose_nothing_and_end_as_uninterrupted_ones(
    tmp_path: Path,
) -> None:
    command = ["-m", "benchmarks.kill_resume", "--kills", str(KILLS), "--json"]
    done = subprocess.run(
        [sys.executable, *command, "--output", str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).resolve().parent.parent.parent,
    )

    assert "" == done.stderr
    outcome = json.loads(done.stdout)
    assert [] == outcome["problems"]
    assert KILLS == outcome["kills"]
    assert outcome["resumes"] > KILLS // 2
    assert outcome["cells_compared"] > 1000
    assert (0, 0, 0, 0) == (
        outcome["lost_trials"],
        outcome["missing_trials"],
        outcome["unequal_cells"],
        outcome["failed_lives"],
    )
    assert 0 == done.returncode

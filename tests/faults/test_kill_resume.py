import json
from pathlib import Path

import pytest

from tests.commands import COMMANDS, ROOT

KILLS = {"stare": 30, "crowd": 10, "waving": 10}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("study", ["stare", "crowd", "waving"])
def test_killed_sessions_lose_nothing_and_end_as_uninterrupted_ones(
    study: str, tmp_path: Path
) -> None:
    kills = KILLS[study]
    command = ["-m", "benchmarks.kill_resume", "--study", study, "--kills", str(kills), "--json"]
    process = COMMANDS.run(*command, "--output", str(tmp_path), cwd=ROOT)

    assert "" == process.stderr
    outcome = json.loads(process.stdout)[study]
    assert [] == outcome["problems"]
    assert kills == outcome["kills"]
    assert outcome["resumes"] > kills // 2
    assert outcome["cells_compared"] > 100
    assert (0, 0, 0, 0) == (
        outcome["lost_trials"],
        outcome["missing_trials"],
        outcome["unequal_cells"],
        outcome["failed_lives"],
    )
    assert 0 == process.returncode

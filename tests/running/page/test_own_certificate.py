"""What stands in the place of this computer's certificate."""

import os
from datetime import UTC, datetime
from pathlib import Path

from visavis.running.page.own_certificate import NAME, own_certificate

NOW = datetime(2026, 11, 1, tzinfo=UTC)


def test_a_pipe_in_place_of_the_certificate_is_replaced_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / NAME)
    own_certificate(tmp_path, ["10.0.0.1"], NOW)
    assert (True, 0o600) == ((tmp_path / NAME).is_file(), (tmp_path / NAME).stat().st_mode & 0o777)

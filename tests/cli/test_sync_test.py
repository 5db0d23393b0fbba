"""`visavis sync-test`: what it recovers, what it keeps, what doctor says of it."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from cli import sync_records
from cli.main import app
from cli.sync_chain import perform_simulated
from devices.sim.sync_room import Planted
from lab.config_files import EXAMPLE
from stage.context import offscreen_context
from stage.errors import StageError


@pytest.fixture(scope="module", autouse=True)
def _something_draws():
    try:
        offscreen_context().release()
    except StageError as missing:
        pytest.skip(str(missing))


@pytest.fixture
def lab_file(tmp_path, monkeypatch):
    path = tmp_path / "lab_config.yaml"
    path.write_text(EXAMPLE.read_text(encoding="utf-8"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return path


def test_planted_delays_and_jitter_are_recovered_through_the_whole_chain():
    found, _, _, true_ms = perform_simulated(
        seed=3, repeats=20, picture=Planted(12.0, 3.0), sound=Planted(40.0, 8.0), rise_ms=0.0
    )

    assert ["picture", "sound", "vibration"] == [one.modality for one in found]
    for one in found:
        true = true_ms[one.modality]
        assert (20, 20) == (one.asked, one.answered)
        assert float(np.median(true)) == pytest.approx(one.median_ms, abs=0.2)
        assert float(np.std(true, ddof=1)) == pytest.approx(one.sd_ms, abs=0.2)


def test_same_seed_gives_the_same_test():
    def again():
        found, _, _, _ = perform_simulated(
            seed=8, repeats=10, picture=Planted(9.0, 1.0), sound=Planted(22.0, 3.0)
        )
        return [one.delays_ms for one in found]

    assert again() == again()


def test_rehearsal_is_kept_and_marked_and_no_measurement_for_doctor(lab_file, tmp_path):
    done = CliRunner().invoke(app, ["sync-test", "--simulated", "--repeats", "10"])

    assert 0 == done.exit_code, done.output
    assert "SIMULATED" in done.output
    (kept,) = (tmp_path / "data" / sync_records.FOLDER).glob("*.json")
    record = json.loads(kept.read_text(encoding="utf-8"))
    assert record["is_simulated"]
    assert kept.with_suffix(".png").is_file()
    assert {"picture_delay_ms", "sound_delay_ms"} <= set(record["offsets_ms"])

    from cli.app import load_lab

    assert sync_records.newest(load_lab(lab_file, quiet=True)) is None


def test_doctor_says_how_old_the_newest_measurement_is(lab_file, tmp_path):
    from cli.app import load_lab

    folder = tmp_path / "data" / sync_records.FOLDER
    folder.mkdir(parents=True)
    for day, delay in (("2026-03-01", 9.0), ("2026-03-05", 11.0)):
        record = {
            "made": f"{day}T10:00:00+00:00",
            "is_simulated": False,
            "offsets_ms": {"picture_delay_ms": delay},
        }
        (folder / f"sync-{day}.json").write_text(json.dumps(record), encoding="utf-8")
    (folder / "sync-2026-03-09.json").write_text("{", encoding="utf-8")
    newest = sync_records.newest(load_lab(lab_file, quiet=True))

    assert {"picture_delay_ms": 11.0} == newest["offsets_ms"]
    assert 30 == pytest.approx(sync_records.age_days(newest, "2026-04-04T12:00:00+02:00"))


@pytest.mark.parametrize("arguments", [[], ["--simulated", "--sensor", "audio"]])
def test_it_asks_for_a_sensor_or_a_rehearsal(lab_file, arguments):
    done = CliRunner().invoke(app, ["sync-test", *arguments])

    assert 0 != done.exit_code
    assert "--simulated" in str(done.exception or done.output)


def test_simulated_display_is_never_taken_for_a_measurement(lab_file):
    done = CliRunner().invoke(app, ["sync-test", "--sensor", "/dev/nowhere"])

    assert 0 != done.exit_code
    assert "display is simulated" in str(done.exception or done.output)

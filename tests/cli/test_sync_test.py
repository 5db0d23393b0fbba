"""`visavis sync-test`: what it recovers, what it keeps, what doctor says of it."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.virtual_screen import run_before_a_screen
from visavis.cli import sync_records
from visavis.cli.app import load_lab
from visavis.cli.doctor import report
from visavis.cli.main import app
from visavis.cli.sync_chain import (
    gaze_bound_of,
    pace_of,
    perform_real,
    perform_simulated,
    pose_age_of,
)
from visavis.devices.registry import OPTION_MODELS
from visavis.devices.sim.sync_room import PlantedDelay
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.config import load_config, parse_config
from visavis.lab.config_files import EXAMPLE, SCREEN_EXAMPLE
from visavis.lab.errors import UsageError
from visavis.stage.card.context import offscreen_context, release_offscreen
from visavis.stage.errors import StageError


@pytest.fixture(scope="module", autouse=True)
def _something_draws():
    try:
        release_offscreen(offscreen_context())
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
        seed=3,
        repeats=20,
        picture=PlantedDelay(12.0, 3.0),
        sound=PlantedDelay(40.0, 8.0),
        rise_ms=0.0,
    )

    assert ["picture", "sound", "vibration"] == [one.modality for one in found]
    for one in found:
        true = true_ms[one.modality]
        assert (20, 20) == (one.asked, one.answered)
        assert float(np.median(true)) == pytest.approx(one.median_ms, abs=0.2)
        assert float(np.std(true, ddof=1)) == pytest.approx(one.sd_ms, abs=0.2)


@pytest.mark.parametrize("rate_hz", [60, 85, 144])
def test_planted_delay_of_a_monitor_is_recovered_in_its_own_rhythm(rate_hz):
    text = SCREEN_EXAMPLE.read_text("utf-8").replace("rate_hz: 60", f"rate_hz: {rate_hz}")
    found, asked, _, true_ms = perform_simulated(
        seed=4,
        repeats=10,
        picture=PlantedDelay(12.0),
        sound=PlantedDelay(40.0),
        lab=parse_config(text, Path("lab_config.yaml"), OPTION_MODELS),
    )
    picture = found[0]

    assert ("screen", 10, 10) == (picture.source, picture.asked, picture.answered)
    assert 12.0 == pytest.approx(float(np.median(true_ms["picture"])), abs=0.001)
    assert 12.0 == pytest.approx(picture.median_ms, abs=0.2)
    assert 0 == asked.dropped_frames == picture.shown_wrong


def test_delay_before_a_monitor_is_measured_in_its_window():
    """Six seconds in real time: five flashes in a window of an X server."""
    outcome = json.loads(run_before_a_screen("tests.cli.sync_test_child", "40", size_px=(640, 360)))

    assert ("picture", "screen", 5, 5) == (
        outcome["modality"],
        outcome["source"],
        outcome["asked"],
        outcome["answered"],
    )
    assert 0 == pytest.approx(np.median(outcome["errors_ms"]), abs=2)
    assert (1, True) == (outcome["windows"], outcome["is_closed"])


def test_pose_age_and_gaze_delay_are_bounded_in_the_same_room():
    found, asked, _, _ = perform_simulated(
        seed=5,
        repeats=12,
        picture=PlantedDelay(9.0),
        sound=PlantedDelay(22.0),
        gaze_delay_ms=12.0,
    )
    age, bound = pose_age_of(asked, found), gaze_bound_of(asked, found, "eye_tracker")

    # the simulated headset foresees the head for its light, two frames ahead
    assert 9.0 == pytest.approx(age.at_least_ms, abs=0.3)
    assert 9.0 + age.look_ahead_ms == pytest.approx(age.at_most_ms, abs=0.3)
    assert age.look_ahead_ms > 10
    assert (12, True) == (bound.target_count, bound.is_known)
    assert 12.0 <= bound.at_most_ms <= 12.0 + 60
    assert () == pace_of(asked).sentences


def test_same_seed_gives_the_same_test():
    def again():
        found, _, _, _ = perform_simulated(
            seed=8, repeats=10, picture=PlantedDelay(9.0, 1.0), sound=PlantedDelay(22.0, 3.0)
        )
        return [one.delays_ms for one in found]

    assert again() == again()


def test_rehearsal_is_kept_and_marked_and_no_measurement_for_doctor(lab_file, tmp_path):
    command = ["sync-test", "--simulated", "--repeats", "10", "--eyes", "eye_tracker"]
    done = CliRunner().invoke(app, command)

    assert 0 == done.exit_code, done.output
    assert "SIMULATED" in done.output
    assert "pose age at the light: " in done.output
    assert "gaze delay of eye_tracker: at most " in done.output
    (kept,) = (tmp_path / "data" / sync_records.FOLDER).glob("*.json")
    record = json.loads(kept.read_text(encoding="utf-8"))
    assert record["is_simulated"]
    assert kept.with_suffix(".png").is_file()
    assert {"picture_delay_ms", "sound_delay_ms"} <= set(record["offsets_ms"])
    assert record["pose_age"]["at_most_ms"] > record["pose_age"]["at_least_ms"] > 8
    assert [] == record["pace"]["warnings"]
    assert record["gaze_delay"]["at_most_ms"] >= 12

    assert sync_records.newest(load_lab(lab_file, quiet=True)) is None


def test_doctor_says_how_old_the_newest_measurement_is(lab_file, tmp_path):
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


def test_rehearsal_before_a_monitor_says_so(lab_file, tmp_path):
    lab_file.write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    done = CliRunner().invoke(app, ["sync-test", "--simulated", "--repeats", "10"])

    assert 0 == done.exit_code, done.output
    (kept,) = (tmp_path / "data" / sync_records.FOLDER).glob("*.json")
    record = json.loads(kept.read_text(encoding="utf-8"))
    assert ["screen", "speaker", "armband_left_forearm"] == [d["source"] for d in record["delays"]]
    assert record["is_simulated"]


NOW = "2026-04-04T12:00:00+00:00"


@pytest.mark.parametrize(
    ("made", "level", "told"),
    [
        ("2026-03-25T12:00:00+00:00", "ok", "10 days old: picture_delay_ms 9, sound_delay_ms 22.5"),
        ("2026-01-03T12:00:00+00:00", "note", "91 days old: picture_delay_ms 9"),
        ("", "note", "delays were never measured here"),
    ],
)
def test_doctor_asks_for_a_test_where_there_is_none_or_it_is_old(
    lab_file, tmp_path, made, level, told
):
    if made:
        folder = tmp_path / "data" / sync_records.FOLDER
        folder.mkdir(parents=True)
        offsets_ms = {"picture_delay_ms": 9.0, "sound_delay_ms": 22.5}
        record = {"made": made, "is_simulated": False, "offsets_ms": offsets_ms}
        (folder / "sync-1.json").write_text(json.dumps(record), encoding="utf-8")

    row = report._sync_test(load_lab(lab_file, quiet=True), At(NOW))

    assert (level, "sync-test") == (row.level, row.subject)
    assert told in row.found
    assert ("visavis sync-test" in row.remedy) == (level == "note")


class At(SimClock):
    """A virtual clock on some day."""

    def __init__(self, wall_iso):
        super().__init__()
        self._wall_iso = wall_iso

    def wall_iso(self):
        return self._wall_iso


@pytest.mark.parametrize("arguments", [[], ["--simulated", "--sensor", "audio"]])
def test_it_asks_for_a_sensor_or_a_rehearsal(lab_file, arguments):
    done = CliRunner().invoke(app, ["sync-test", *arguments])

    assert 0 != done.exit_code
    assert "--simulated" in str(done.exception or done.output)


def test_simulated_display_is_never_taken_for_a_measurement(lab_file):
    done = CliRunner().invoke(app, ["sync-test", "--sensor", "/dev/nowhere"])

    assert 0 != done.exit_code
    assert "display is simulated" in str(done.exception or done.output)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--sensor", "role:eye_tracker"], "eye_tracker is simulated"),
        (["--sensor", "audio", "--band", "responses"], "responses is simulated"),
        (["--sensor", "role:eeg"], "no role 'eeg'"),
    ],
)
def test_before_a_monitor_no_simulated_device_measures_or_is_measured(
    lab_file, arguments, said, monkeypatch
):
    monkeypatch.setattr("visavis.cli.sync_chain.sound_library", lambda: None)
    lab_file.write_text(SCREEN_EXAMPLE.read_text("utf-8"), "utf-8")
    done = CliRunner().invoke(app, ["sync-test", *arguments])

    assert isinstance(done.exception, UsageError)
    assert said in str(done.exception)


def test_lab_without_any_display_is_told_what_to_add(lab_file):
    lab = load_config(lab_file)
    devices = {role: d for role, d in lab.devices.items() if role != "headset"}
    with pytest.raises(UsageError, match=r"no display to test.*docs/screens"):
        perform_real(
            lab.model_copy(update={"devices": devices}),
            SystemClock(),
            sensor_name="audio",
            speaker_name="",
            band_role="",
            channels={},
            repeats=10,
            progress=lambda done: None,
        )

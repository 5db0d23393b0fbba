"""Films with a voice: what is heard on a page, and before a headset from the speaker's head."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.running.page.pages import SEED, config
from visavis.lab.config import DeviceConfig
from visavis.lab.errors import DataError, DesignError
from visavis.recording.reader import Recording
from visavis.results.opened_study import OpenedStudy, find_study
from visavis.running.film_store import film_store
from visavis.running.sessions.perform import perform_new
from visavis.running.sessions.session_request import simulated_request
from visavis.stimuli.sound import Waveform, part_of
from visavis.study.films import Film, Pair, Voice, voiced_film
from visavis.study.scenes import Scene

STUDY = Path(__file__).parents[1] / "studies" / "heard.py"
TONE = Waveform("tone", np.ones((100, 1), np.float32), 100)


def performed(on: str, root: Path, **parameters: Any) -> Recording:
    study = find_study(str(STUDY))
    assert isinstance(study, OpenedStudy)
    made = study.experiment(parameters)
    sound = DeviceConfig(role="sound", driver="sound_card", simulated=True, options={})
    lab = config(root)
    lab = lab.model_copy(update={"devices": {**lab.devices, "sound": sound}})
    request = simulated_request(study, made, lab, label="S01B", index=0, seed=SEED)
    return Recording(perform_new(replace(request, on=on)))


def test_a_part_of_a_recording_is_silent_after_its_end_and_does_not_begin_there() -> None:
    part = part_of(TONE, 0.5, 1.0)
    assert part.samples[:, 0].tolist() == [1.0] * 50 + [0.0] * 50
    with pytest.raises(DataError, match=r"tone lasts 1.00 s; nothing of it is left at 1 s"):
        part_of(TONE, 1.0, 1.0)


def test_a_part_that_begins_before_a_recording_is_silent_until_then() -> None:
    assert part_of(TONE, -0.5, 1.0).samples[:, 0].tolist() == [0.0] * 50 + [1.0] * 50
    with pytest.raises(DataError, match=r"nothing of it is left at -1 s"):
        part_of(TONE, -1.0, 1.0)


def test_one_film_of_a_pair_is_heard() -> None:
    silent, heard = (
        Film(Scene("person"), 1.0, voice=voice) for voice in (None, Voice("speech.wav"))
    )
    assert voiced_film(Pair(silent, heard)) is heard
    assert voiced_film(silent) is None


def test_a_film_with_other_sound_is_another_film() -> None:
    study = find_study(str(STUDY))
    assert isinstance(study, OpenedStudy)
    films = [study.experiment({"from_s": from_s}).films[0] for from_s in (2.5, 3.0)]
    store = film_store(study.experiment({}))
    assert store.name_of(films[0]) != store.name_of(films[1])
    assert store.describe(films[0], is_simulated=True)["mime"].endswith('opus"')


def test_a_page_records_when_the_sound_began_and_how_loud(tmp_path: Path) -> None:
    row = performed("browser", tmp_path).trials().iloc[0]
    assert row["film_sound_on_ns"] == row["film_on_ns"]
    assert row["film_volume_01"] == row["film2_volume_01"] == 1.0


def test_before_a_headset_the_same_sound_comes_from_the_speakers_head(tmp_path: Path) -> None:
    recording = performed("lab", tmp_path)
    row = recording.trials().iloc[0]
    frame_ns = 50_000_000
    assert 0 <= row["film_sound_on_ns"] - row["film_on_ns"] < frame_ns
    assert 0 <= row["film2_sound_on_ns"] - row["film2_on_ns"] < frame_ns
    alone, of_pair = recording.events_named("sound", 1)["payload"][:2]
    assert alone["sound_sha256"] == of_pair["sound_sha256"]
    assert alone["seconds"] == 2.0
    assert 1.4 < alone["y_m"] < 1.8
    # Of a pair, from between both.
    assert [of_pair[name] for name in ("x_m", "z_m")] == pytest.approx(
        [alone[name] for name in ("x_m", "z_m")]
    )


def test_nobody_plays_the_speaker_is_told(tmp_path: Path) -> None:
    with pytest.raises(DesignError, match="spoken by 'nobody', whom nobody in it plays"):
        performed("lab", tmp_path, speaker="nobody")

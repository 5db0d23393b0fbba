"""Maps of gaze on panoramas: the whole picture, gaze where it was in it, and its areas."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from visavis.analysis.gaze.sphere_maps import SphereGrid
from visavis.cli.app import app
from visavis.cli.gaze_map import (
    AT_MIDDLE,
    TrialGaze,
    gaze_maps,
    maps_of_people,
)
from visavis.cli.gaze_map_figure import figure_of_panels, table_of_maps
from visavis.cli.recorded_trial import recorded_trial
from visavis.lab.errors import UsageError
from visavis.lab.geometry import direction_from_yaw_pitch_deg
from visavis.recording.cached import CachedRecording
from visavis.running.scripts import open_study
from visavis.stage.errors import StageError
from visavis.stage.renderer import LIGHTEST, Renderer
from visavis.stimuli.flat import Panorama

GRID = SphereGrid()
STUDY = """
from visavis import Factor, Panorama, Study, Text, looks_at

study = Study(
    "seen", factors=[Factor("ahead", [0, 120])], repetitions=1, calibrate=False,
    measures=[looks_at("door")[0]],
)

@study.trial
def trial(t):
    yield t.show(Text("+"), seconds=0.5, name="fixation")
    yield t.show(Panorama("FILE", yaw_deg=t.ahead, areas="areas.yaml"), 4)
"""
AREAS = """door: {ellipse: [60, 10, 16, 16], salience: 60}
lamp: {ellipse: [180, -20, 30, 10], salience: 0.01}
"""


@pytest.fixture(scope="module", autouse=True)
def drawing() -> None:
    try:
        Renderer(quality=LIGHTEST).close()
    except StageError as problem:
        pytest.skip(str(problem))


def simulate_study(folder: Path, monkeypatch: pytest.MonkeyPatch, file: str, display: str) -> Path:
    monkeypatch.chdir(folder)
    (folder / "seen.py").write_text(STUDY.replace("FILE", file), "utf-8")
    (folder / "areas.yaml").write_text(AREAS, "utf-8")
    for command in (
        f"init {display}",
        "simulate ./seen.py --participants 1 --processes 1 --output data",
    ):
        result: Any = CliRunner().invoke(app, command.split())
        assert 0 == result.exit_code, result.output
    return folder / "data" / "simulated" / "seen"


def save_panorama(path: Path) -> None:
    """Save a panorama that is darker on its left."""
    pixels = np.full((1024, 2048, 3), 200, np.uint8)
    pixels[:, :1024] = 40
    Image.fromarray(pixels).save(path)


def share_within(density: Any, right_deg: float, up_deg: float, within_deg: float) -> float:
    """Return the share of time within so many degrees of a place."""
    right, up = np.meshgrid(*GRID.centres())
    cells = direction_from_yaw_pitch_deg(-right, up)
    place = direction_from_yaw_pitch_deg(np.asarray(-right_deg), np.asarray(up_deg))
    near = np.degrees(np.arccos(np.clip(cells @ place, -1, 1))) < within_deg
    time_s = density * GRID.area_deg2()
    return float(time_s[near].sum() / time_s.sum())


@pytest.mark.parametrize("display", ["--screen", ""], ids=["screen", "headset"])
def test_gaze_lies_where_it_was_in_the_picture_whatever_was_ahead_at_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, display: str
) -> None:
    save_panorama(tmp_path / "a.png")
    data = open_study(simulate_study(tmp_path, monkeypatch, "a.png", display))
    (maps,) = gaze_maps(data, "ahead", peek=None, on_trial=lambda count, total: None)
    assert ("0", "120") == maps.levels
    assert (720, 1440, 3) == maps.image.shape
    assert [40, 200] == maps.image[300, [100, 1300], 0].tolist()
    recording = CachedRecording(data.sessions[0].path)
    for row in recording.trials().to_dict("records"):
        (density,) = maps.maps[str(row["ahead"])]
        gaze = recorded_trial(recording, row["trial_id"]).gaze
        t_ns = gaze["t_sample_ns"]
        is_lit = (t_ns >= row["stimulus_on_ns"]) & (t_ns < row["stimulus_off_ns"])
        usable_s = 4 * (gaze["valid"] & is_lit).sum() / is_lit.sum()
        assert usable_s == pytest.approx((density * GRID.area_deg2()).sum(), rel=0.02)
        assert share_within(density, 60, 10, 12) > (0.3 if not display else 0.1)
    ((_, (door,)), *lamps) = maps.outlines
    assert [60, 10] == pytest.approx(door.mean(axis=0).tolist())
    assert [("lamp", -180.0), ("lamp", 180.0)] == [
        (name, pytest.approx(corners[:, 0].mean())) for name, (corners,) in lamps
    ]
    table = table_of_maps(maps, is_simulated=True)
    assert 2 * GRID.rows * GRID.columns == len(table)
    assert (-179.5, 89.5) == tuple(table.loc[0, ["right_deg", "up_deg"]])
    assert (179.5, -89.5) == tuple(table.iloc[-1][["right_deg", "up_deg"]])


def test_the_verb_draws_the_whole_picture_with_axes_in_degrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_panorama(tmp_path / "a.png")
    simulate_study(tmp_path, monkeypatch, "a.png", "--screen")
    command = "gaze-map data/simulated/seen --by ahead --during stimulus -o map"
    result: Any = CliRunner().invoke(app, command.split())
    assert 0 == result.exit_code, result.output
    assert {"csv", "png", "svg"} == {path.suffix[1:] for path in (tmp_path / "map").iterdir()}
    # what stood flat before it has a map as other flat stimuli have
    data = open_study(tmp_path / "data" / "simulated" / "seen")
    (flat,) = gaze_maps(data, "ahead", peek=None, on_trial=lambda *of: None, during="fixation")
    assert not isinstance(flat.grid, SphereGrid)


def test_painted_areas_are_outlined_by_name_whole_across_the_edge_of_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_panorama(tmp_path / "a.png")
    painting = np.zeros((1024, 2048, 3), np.uint8)
    painting[512:704, :64] = painting[512:704, -128:] = (255, 0, 0)  # cut by the picture's edge
    painting[560:600, -64:-32] = 0  # a hole
    painting[384:512, 1280:1408] = (0, 80, 255)
    Image.fromarray(painting).save(tmp_path / "painted.png")
    words = STUDY.replace("areas.yaml", "painted.png").replace('"door"', '"blue"')
    monkeypatch.setattr(f"{__name__}.STUDY", words)
    data = open_study(simulate_study(tmp_path, monkeypatch, "a.png", "--screen"))
    (maps,) = gaze_maps(data, "ahead", peek=None, on_trial=lambda *of: None)
    (_, (blue,)), (_, (left,)), (_, (right, hole)) = maps.outlines
    box = [(line.min(axis=0).tolist(), line.max(axis=0).tolist()) for line in (blue, left, right)]
    assert [
        ([45.0, 0.0], [67.5, 22.5]),
        ([-202.5, -33.75], [-168.75, 0.0]),
        ([157.5, -33.75], [191.25, 0.0]),
    ] == [(pytest.approx(low), pytest.approx(high)) for low, high in box]
    assert 360 * 32 / 2048 == pytest.approx(np.ptp(hole[:, 0]))
    panels = figure_of_panels(maps, {"0": "0", "120": "120"}).axes
    for panel in panels[:2]:
        assert ["blue", "red", "red"] == [text.get_text() for text in panel.texts]
        assert 4 == len(panel.patches)
        for text in panel.texts:  # a name is where one sees it
            assert (abs(np.array(text.xy)) <= [180, 90]).all()


def test_a_film_all_around_is_drawn_as_it_was_some_time_after_its_onset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("av")
    from tests.panoramic_film import RATE_HZ, number_ahead, write_film_around

    write_film_around(tmp_path / "lake.mp4", 4 * RATE_HZ)
    data = open_study(simulate_study(tmp_path, monkeypatch, "lake.mp4", ""))
    (maps,) = gaze_maps(data, "ahead", peek=None, on_trial=lambda *of: None, during="stimulus")
    assert RATE_HZ * 4 // 8 == number_ahead(maps.image[360, 720])


def test_reversed_gaze_moves_the_map_of_a_person() -> None:
    towards = direction_from_yaw_pitch_deg(np.array([-100.5, -100.5]), np.array([70.5, 70.5]))
    peaks = []
    for ends in (towards, towards * [-1, -1, 1]):
        one = TrialGaze("07K", "A", np.zeros((2, 3)), ends, np.ones(2), (Panorama("a.png"),))
        density = maps_of_people([one, one], AT_MIDDLE, GRID)["07K"]
        assert 2 == pytest.approx((density * GRID.area_deg2()).sum())  # of a trial
        row, column = np.unravel_index(density.argmax(), GRID.shape)
        right, up = GRID.centres()
        peaks.append((right[column], up[row]))
    assert [(100.5, 70.5), (-100.5, -70.5)] == [pytest.approx(peak) for peak in peaks]


def test_a_session_without_gaze_while_a_panorama_was_there_has_no_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_panorama(tmp_path / "a.png")
    folder = simulate_study(tmp_path, monkeypatch, "a.png", "")
    data = open_study(folder)
    data.analysis()
    names = CachedRecording(data.sessions[0].path).stream_names
    others = [name for name in names if name != "gaze_targets"]
    monkeypatch.setattr(CachedRecording, "stream_names", others)
    with pytest.raises(UsageError, match="no trial that counts has usable gaze"):
        gaze_maps(data, "ahead", peek=None, on_trial=lambda *of: None)

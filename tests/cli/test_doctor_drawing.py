"""What doctor says of drawing: whether frames are in time, and what to ask of pictures if not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.stage import figures
from visavis.cli.doctor import drawing
from visavis.cli.doctor.drawing import advice, measure_drawing
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.stage.card.context import draws_on_processor
from visavis.stage.errors import StageError
from visavis.stage.frame_cost import CHOICES, Choice, best_choice, stereo_frame_ms
from visavis.stage.renderer import Quality, Renderer

HEAD = Pose(np.array([0.0, 1.5, 1.0]), quat_from_yaw_pitch_deg(0.0))


@pytest.fixture
def lab() -> LabConfig:
    return load_config(EXAMPLE)


def costing(ms_per_sample: float) -> dict[Choice, float]:
    """Return what choices cost where samples and pixels cost alike."""
    every = (*CHOICES, Choice(4, 1.0))
    return {c: ms_per_sample * max(c.samples, 1) * c.render_scale**2 for c in every}


def test_frames_in_time_need_no_advice(lab: LabConfig) -> None:
    finding = advice(lab, "card", 90.0, costing(1.9).__getitem__, costing(5.0).__getitem__)
    assert ("ok", "") == (finding.level, finding.remedy)
    assert "7.6 ms a stereo frame" in finding.found


def test_cards_with_time_to_spare_are_offered_shadows_of_areas(lab: LabConfig) -> None:
    offered = "there is time for shadows: area"
    cheap, fast, slow = (costing(ms).__getitem__ for ms in (0.6, 1.9, 2.1))
    assert f"{offered} (7.6 ms)" in advice(lab, "card", 90.0, cheap, fast).found
    assert offered not in advice(lab, "card", 90.0, cheap, slow).found
    quality = lab.display.quality.model_copy(update={"shadows": "area"})
    display = lab.display.model_copy(update={"quality": quality})
    dear = lab.model_copy(update={"display": display})
    assert offered not in advice(dear, "card", 90.0, cheap, cheap).found
    assert "shadows: maps" in advice(dear, "card", 90.0, costing(3.0).__getitem__, slow).remedy


def test_the_best_that_is_in_time_is_advised(lab: LabConfig) -> None:
    finding = advice(lab, "card", 90.0, costing(3.0).__getitem__, costing(9.0).__getitem__)
    assert finding.level == "warning"
    assert "samples: 2, render_scale: 1 (6.0 ms)" in finding.remedy


def test_a_card_too_slow_for_anything_is_told_so(lab: LabConfig) -> None:
    finding = advice(lab, "card", 90.0, costing(100.0).__getitem__, costing(300.0).__getitem__)
    assert "samples: 0, render_scale: 0.6" in finding.remedy
    assert "faster card" in finding.remedy


def test_choices_get_cheaper_and_the_first_in_time_is_taken() -> None:
    costs = costing(1.0)
    assert sorted(costs[c] for c in CHOICES) == [costs[c] for c in reversed(CHOICES)]
    assert (Choice(8, 1.0), 7.0) == best_choice(lambda _: 7.0, 90.0)
    assert (CHOICES[-1], 9.0) == best_choice(lambda _: 9.0, 90.0)


def test_a_frame_is_measured_by_what_draws(lab: LabConfig) -> None:
    try:
        renderer = Renderer(quality=Quality(samples=0, shadows="none"))
    except StageError as problem:
        pytest.skip(str(problem))
    with renderer:
        clock, picture = SystemClock(), replace(figures.picture(1))
        assert stereo_frame_ms(renderer, picture, HEAD, (32, 36), Choice(2, 0.5), clock) > 0.0
        if not draws_on_processor(renderer.context):
            pytest.skip("a card draws here")
    finding = measure_drawing(lab, SystemClock())
    assert finding.level == "warning"
    assert "no graphics card draws" in finding.found


def test_shadows_of_areas_are_timed_before_they_are_offered(
    lab: LabConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[str] = []

    def counted(renderer: Renderer, *_: object) -> float:
        drawn.append(renderer.quality.shadows)
        return 2.0 if renderer.quality.shadows == "maps" else 7.0

    try:
        Renderer(quality=Quality(samples=0, shadows="none")).close()
    except StageError as problem:
        pytest.skip(str(problem))
    monkeypatch.setattr(drawing, "draws_on_processor", lambda _: False)
    monkeypatch.setattr(drawing, "stereo_frame_ms", counted)
    finding = drawing.measure_drawing(lab, SystemClock())
    assert drawn == ["maps", "area"]
    assert "there is time for shadows: area (7.0 ms)" in finding.found

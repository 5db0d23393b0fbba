"""What a lab asks of its pictures is what is drawn; the rest suits its computer."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from visavis.lab.config import LabConfig, load_config
from visavis.lab.config_files import EXAMPLE
from visavis.lab.errors import ConfigError
from visavis.running.sessions.drawn_stages import _of_headset, quality_of
from visavis.stage.renderer import ON_PROCESSOR, Quality


def lab(folder: Path, *lines: str) -> LabConfig:
    """Return the example's lab with lines under `display.quality`."""
    path = folder / "lab_config.yaml"
    asked = "".join(f"    {line}\n" for line in lines)
    text = EXAMPLE.read_text().replace("  show: none\n", f"  show: none\n  quality:\n{asked}")
    path.write_text(text)
    return load_config(path)


def test_nothing_asked_is_what_suits_the_computer() -> None:
    config = load_config(EXAMPLE)
    assert Quality() == quality_of(config, on_processor=False)
    assert ON_PROCESSOR == quality_of(config, on_processor=True)


def test_what_is_asked_is_drawn(tmp_path: Path) -> None:
    config = lab(
        tmp_path, "samples: 8", "full_detail_px: 48", "shadows: maps", "shadow_map_px: 2048"
    )
    asked = quality_of(config, on_processor=False)
    assert (8, "maps", 2048) == (asked.samples, asked.shadows, asked.shadow_map_px)
    assert (48.0, 18.0) == asked.detail.faces_px
    assert Quality().detail.budget_triangles == asked.detail.budget_triangles


def test_a_processor_draws_blobs_for_maps(tmp_path: Path) -> None:
    assert "blobs" == quality_of(lab(tmp_path, "shadows: maps"), on_processor=True).shadows
    assert "blobs" == quality_of(lab(tmp_path, "shadows: area"), on_processor=True).shadows
    assert "area" == quality_of(lab(tmp_path, "shadows: area"), on_processor=False).shadows
    assert "none" == quality_of(lab(tmp_path, "shadows: none"), on_processor=True).shadows


def test_render_scale_is_of_what_the_headset_asks_for(tmp_path: Path) -> None:
    headset = SimpleNamespace(
        eye_views=lambda: (), render_size_px=(1440, 1600), display_rate_hz=90.0
    )
    rig: Any = SimpleNamespace(headset=headset)
    shown = _of_headset(lab(tmp_path, "render_scale: 0.75"), rig, 3)
    assert (1080, 1200) == shown.size_px()


@pytest.mark.parametrize("line", ["samples: 3", "render_scale: 4", "shadows: soft", "smooth: 1"])
def test_what_cannot_be_drawn_is_refused(tmp_path: Path, line: str) -> None:
    with pytest.raises(ConfigError, match=line.partition(":")[0]):
        lab(tmp_path, line)

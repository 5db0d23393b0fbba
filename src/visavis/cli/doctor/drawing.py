"""Measure the time of a stereo frame, and recommend a drawing quality that fits in time."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from visavis.cli.doctor.findings import Finding
from visavis.lab.clock import Clock
from visavis.lab.config import LabConfig
from visavis.lab.geometry import Pose, quat_from_yaw_pitch_deg
from visavis.running.sessions.drawn_stages import USUAL_EYE_PX, quality_of
from visavis.stage.card.context import draws_on_processor, offscreen_context, release_offscreen
from visavis.stage.frame_cost import CHOICES, Choice, best_choice, fits, stereo_frame_ms
from visavis.stage.renderer import Renderer
from visavis.stimuli.dressing.station import station_picture
from visavis.stimuli.picture import Picture
from visavis.stimuli.scenes import station_crowd

COMPUTER = "computer"
USUAL_RATE_HZ = 90.0


def measure_drawing(lab: LabConfig, clock: Clock) -> Finding:
    """Measure how long the station's crowd takes to draw for both eyes at a headset's usual size.

    Raises:
        StageError: no graphics context can be opened.
    """
    context = offscreen_context()
    try:
        card = str(context.info.get("GL_RENDERER", "unknown"))
        if draws_on_processor(context):
            text = f"no graphics card draws ({card}); a headset needs one"
            return Finding(COMPUTER, "drawing", "warning", text, "install the card's driver")
        picture, head = _crowd()
        headset = lab.devices.get("headset")
        options = {} if headset is None else headset.options
        rate_hz = float(options.get("display_rate_hz") or USUAL_RATE_HZ)
        quality = quality_of(lab, on_processor=False)

        def with_area_ms(choice: Choice) -> float:
            with Renderer(context, quality=replace(quality, shadows="area")) as renderer:
                return stereo_frame_ms(renderer, picture, head, USUAL_EYE_PX, choice, clock)

        with Renderer(context, quality=quality) as renderer:

            def cost_ms(choice: Choice) -> float:
                return stereo_frame_ms(renderer, picture, head, USUAL_EYE_PX, choice, clock)

            return advice(lab, card, rate_hz, cost_ms, with_area_ms)
    finally:
        release_offscreen(context)


def advice(
    lab: LabConfig,
    card: str,
    rate_hz: float,
    cost_ms: Callable[[Choice], float],
    with_area_ms: Callable[[Choice], float],
) -> Finding:
    """Return whether the lab's drawing quality fits in a frame, else a quality that does.

    `cost_ms` measures a frame with a choice. `with_area_ms` does so with shadows of lamps that
    have an area; it is called only where there may be time for them.
    """
    display_quality = lab.display.quality
    quality = quality_of(lab, on_processor=False)
    now = Choice(quality.samples, display_quality.render_scale)
    now_ms = cost_ms(now)
    text = (
        f"{card}: {now_ms:.1f} ms a stereo frame of the station's crowd with {_setting_text(now)}; "
        f"a frame at {rate_hz:g} Hz has {1e3 / rate_hz:.1f} ms"
    )
    if fits(now_ms, rate_hz):
        if quality.shadows == "maps":
            area_ms = with_area_ms(now)
            if fits(area_ms, rate_hz):
                text += f"; there is time for shadows: area ({area_ms:.1f} ms)"
        return Finding(COMPUTER, "drawing", "ok", text)
    less = [c for c in CHOICES if c.samples <= now.samples and c.render_scale <= now.render_scale]
    choice, chosen_ms = best_choice(cost_ms, rate_hz, [c for c in less if c != now] or CHOICES[-1:])
    remedy = f"set under display.quality {_setting_text(choice)} ({chosen_ms:.1f} ms)"
    if quality.shadows == "area":
        remedy = f"set shadows: maps under display.quality and ask again, or {remedy}"
    if not fits(chosen_ms, rate_hz):
        remedy += ", and shadows: blobs; or take a faster card"
    return Finding(COMPUTER, "drawing", "warning", text, remedy)


def _setting_text(choice: Choice) -> str:
    return f"samples: {choice.samples}, render_scale: {choice.render_scale:g}"


def _crowd() -> tuple[Picture, Pose]:
    """Return the slowest scene of our own studies, and the head of a participant in it."""
    scene = station_crowd.CrowdScene("station", (), crowd=station_crowd.station_crowd(1))
    frame = station_crowd.CrowdFrame(
        scene, 0, np.zeros((0, 3)), np.zeros(0), crowd_t_ns=3_000_000_000, track=None
    )
    x, z = station_crowd.START_M
    return station_picture(frame), Pose(np.array([x, 1.65, z]), quat_from_yaw_pitch_deg(0.0))

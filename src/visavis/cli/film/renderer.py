"""Draws what sessions show off the screen, for films and maps of them."""

from dataclasses import replace

from visavis.stage.card.context import draws_on_processor, offscreen_context, release_offscreen
from visavis.stage.renderer import ON_PROCESSOR, Quality
from visavis.stage.stills import TIMES, Stills


def session_drawing() -> Stills:
    """Open what draws as a session on this computer would by default, with smooth edges.

    Films that participants watch are drawn alike everywhere (`running.film_store.film_drawing`).
    """
    context = offscreen_context()
    try:
        on_processor = draws_on_processor(context)
    finally:
        release_offscreen(context)
    return Stills(replace(ON_PROCESSOR, shrink_factor=TIMES) if on_processor else Quality())

"""Draws films and pages off the screen."""

from collections.abc import Iterator
from contextlib import contextmanager

from visavis.stage.card.context import draws_on_processor, offscreen_context, release_offscreen
from visavis.stage.renderer import Quality, Renderer


@contextmanager
def film_renderer(on_processor: "Quality | None" = None) -> "Iterator[Renderer]":
    """Open a renderer. Where a processor draws, pictures have the given quality, by default without
    smoothing, which is slow there.
    """
    context = offscreen_context()
    try:
        lighter = Quality(samples=0) if on_processor is None else on_processor
        quality = lighter if draws_on_processor(context) else Quality()
        with Renderer(context, quality=quality) as renderer:
            yield renderer
    finally:
        release_offscreen(context)

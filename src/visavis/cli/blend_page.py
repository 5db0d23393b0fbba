"""Serve and open the page on which sliders blend motions, until it is ended from the keyboard."""

import asyncio
import contextlib
import webbrowser

from visavis.cli.app import say
from visavis.running.page.playground import Play, Playground


def show_page(play: Play) -> None:
    """Serve a figure to play with and open it in the browser; returns after Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(Playground(play)))


async def _serve(server: Playground) -> None:
    await server.start()
    address = server.address("")
    say(f"{address}  move the sliders; Ctrl-C ends it")
    webbrowser.open(address)
    try:
        await asyncio.Event().wait()
    finally:
        await server.stop()

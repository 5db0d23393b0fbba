"""Serve a session's page for a headset's browser until it is ended from the keyboard."""

import asyncio
import contextlib
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from visavis.cli.app import console, errors, verbatim
from visavis.cli.way_in import LOOPBACK, Listening, Way, words_of_code
from visavis.lab.clock import SystemClock
from visavis.lab.errors import DeviceError
from visavis.running.page.behind_code import PageBehindCode
from visavis.running.page.opening_code import OpeningCode

FREE_PORT: Final = 0


def serve_page(
    way: Way, listening: Listening, page: Path, files: Sequence[Path], *, shows: bool
) -> None:
    """Serve a page and its files; returns after Ctrl-C. `shows` opens it in the browser here."""
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(_serve(way, listening, page, files, shows))


async def _serve(
    way: Way, listening: Listening, page: Path, files: Sequence[Path], shows: bool
) -> None:
    def warn(text: str) -> None:
        errors.print(f"[yellow]{verbatim(text)}[/]", soft_wrap=True)

    code = OpeningCode(say=warn)
    certificate = listening.certificate
    for port in (way.port, FREE_PORT):
        server = PageBehindCode(page, files, code, SystemClock(), listening.names)
        try:
            await server.start(listening.host, port, certificate.context if certificate else None)
        except DeviceError:
            if port == FREE_PORT:
                raise
        else:
            break
    scheme = "http" if certificate is None else "https"
    own = f"{scheme}://{LOOPBACK[1]}:{server.port}"
    if way.is_lan:
        console.print("In the headset's browser:")
    else:
        console.print(
            "In a browser here that a headset is joined to, or in a headset's own by cable "
            f"(adb reverse tcp:{server.port} tcp:{server.port}); --lan serves the network:",
            soft_wrap=True,
        )
    for address in [f"{scheme}://{name}:{server.port}" for name in listening.near] or [own]:
        console.print(f"  [b]{verbatim(address)}[/]", soft_wrap=True, highlight=False)
    for line in words_of_code(way, code.digits, certificate):
        console.print(line, soft_wrap=True, highlight=False)
    console.print("Ctrl-C ends it.")
    if shows:
        webbrowser.open(own + server.page_path)
    try:
        await asyncio.Event().wait()
    finally:
        await server.stop()

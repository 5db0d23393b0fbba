"""desk: a page beside the terminal that shows the lab's session and commands it."""

import asyncio
import contextlib
import importlib
import webbrowser
from typing import Annotated, Any

import typer

from cli.app import ConfigOption, DevicesOption, app, console, load_lab, say, verbatim
from lab.config import LabConfig
from lab.errors import ConfigError


@app.command()
def desk(
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page; a free one left out.")
    ] = 0,
    show: Annotated[bool, typer.Option("--show", help="Open it in the browser.")] = False,
    devices: DevicesOption = None,
    config: ConfigOption = None,
) -> None:
    """Show today's people, the doctor's findings and the running session on a page here.

    The page is this computer's alone. It finds the session that records into this lab's data root,
    whenever that begins, and may be closed and opened again; the session does not need it.

    Example: visavis desk --show
    """
    lab = load_lab(config, devices)
    server = _desk_server()(lab)
    with contextlib.suppress(KeyboardInterrupt):  # which is how a desk is closed
        asyncio.run(_serve(server, lab, port, show=show))


async def _serve(server: Any, lab: LabConfig, port: int, *, show: bool) -> None:
    address = await server.start(port)
    say(f"The desk of {verbatim(lab.lab)}, on this computer:")
    console.print(f"  [b]{verbatim(address)}[/]", soft_wrap=True, highlight=False)
    console.print("Ctrl-C closes it; sessions go on without it.")
    if show:
        webbrowser.open(address)
    await server.run()


def _desk_server() -> Any:
    """Return what serves the desk, which not every lab needs.

    Raises:
        ConfigError: its libraries are not installed.
    """
    try:
        return importlib.import_module("cli.desk.server").DeskServer
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"the desk needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error

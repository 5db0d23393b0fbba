"""desk: a page beside the terminal that shows the lab's session and commands it."""

import asyncio
import contextlib
import importlib
import json
import webbrowser
from pathlib import Path
from typing import Annotated, Any

import typer

from visavis.cli.app import ConfigOption, DevicesOption, app, console, load_lab, say, verbatim
from visavis.lab.config import LabConfig
from visavis.lab.errors import ConfigError, UsageError
from visavis.recording.durable import replace_secret


@app.command()
def desk(
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page; a free one left out.")
    ] = 0,
    show: Annotated[bool, typer.Option("--show", help="Open it in the browser.")] = False,
    api: Annotated[
        Path | None,
        typer.Option("--api", help="Write address and key for other programs into this file."),
    ] = None,
    rcs: Annotated[
        int | None,
        typer.Option("--rcs", min=0, max=65535, help="Take LabRecorder's remote commands here."),
    ] = None,
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
    with contextlib.suppress(KeyboardInterrupt):  # Ctrl-C is how a desk is closed
        asyncio.run(_serve(server, lab, port, show=show, api=api, rcs=rcs))


async def _serve(
    server: Any, lab: LabConfig, port: int, *, show: bool, api: Path | None, rcs: int | None
) -> None:
    address = await server.start(port)
    remote = None if rcs is None else await server.listen_as_lab_recorder(rcs)
    if api is not None:
        _write_api(api, address.partition("/#")[0], server.key)
    say(f"The desk of {verbatim(lab.lab)}, on this computer:")
    console.print(f"  [b]{verbatim(address)}[/]", soft_wrap=True, highlight=False)
    if remote is not None:
        console.print(f"LabRecorder's remote commands (start, stop) are taken at port {remote}.")
    console.print("Ctrl-C closes it; sessions go on without it.")
    if show:
        webbrowser.open(address)
    try:
        await server.run()
    finally:
        if api is not None:
            api.unlink(missing_ok=True)


def _write_api(path: Path, address: str, key: str) -> None:
    """Write the desk's address and key to a file that only this account can read.

    Raises:
        UsageError: the file cannot be written.
    """
    try:
        replace_secret(path, json.dumps({"address": address, "key": key}).encode())
    except OSError as error:
        raise UsageError(
            f"{path} cannot be written ({error.strerror or error}); give another file with --api"
        ) from error


def _desk_server() -> Any:
    """Return the class of the desk's server, imported late: not every lab installs its libraries.

    Raises:
        ConfigError: the libraries are not installed.
    """
    try:
        return importlib.import_module("visavis.cli.desk.server").DeskServer
    except ModuleNotFoundError as error:
        raise ConfigError(
            f"the desk needs {error.name}, which is not installed; run: pip install "
            "'visavis[browser]'"
        ) from error

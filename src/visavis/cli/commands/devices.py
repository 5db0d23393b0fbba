"""devices: list, test, identify, setup, luminance, rules, capture, replay."""

import shutil
import subprocess
from dataclasses import asdict, replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from visavis.cli.app import (
    ConfigOption,
    JsonOption,
    app,
    console,
    load_lab,
    say,
    say_json,
    say_written,
    verbatim,
)
from visavis.cli.device_report import print_trials
from visavis.cli.showing_devices import shown_pictures, with_their_headset
from visavis.devices.access_rules import RULES_PATH, access_rules
from visavis.devices.bench import Trial, capture
from visavis.devices.captures import device_of, note_of
from visavis.devices.drivers.armband.status import UNANSWERED_TEXT
from visavis.devices.identify import buzz
from visavis.devices.registry import driver_wiring
from visavis.devices.states import driver_states, role_states
from visavis.devices.wirelog import read_wire_log
from visavis.devices.wires import CapturedWires, ReplayedWires
from visavis.devices.wiring import Site
from visavis.lab.clock import SimClock, SystemClock
from visavis.lab.config import DeviceConfig, LabConfig
from visavis.lab.errors import DataError, DeviceError, UsageError
from visavis.lab.luminance import MIN_LEVELS, WHITE, luminance_table, read_luminance
from visavis.lab.yaml_lines import did_you_mean

devices_app = typer.Typer(help="What devices there are, and whether they work.")
app.add_typer(devices_app, name="devices")

RolesArgument = Annotated[
    list[str] | None, typer.Argument(help="Roles of lab_config.yaml; all when left out.")
]
RoleArgument = Annotated[str, typer.Argument(help="A role of lab_config.yaml.")]
SecondsOption = Annotated[float, typer.Option("--seconds", help="How long to listen.")]
MAX_S = 3600.0


@devices_app.command("list")
def list_devices(config: ConfigOption = None, as_json: JsonOption = False) -> None:
    """List the roles of this lab and the drivers there are, each with its state.

    Example: visavis devices list
    """
    lab = load_lab(config, quiet=as_json)
    roles, drivers = role_states(lab), driver_states()
    if as_json:
        report = {"roles": [asdict(r) for r in roles], "drivers": [asdict(d) for d in drivers]}
        say_json(report)
        return
    table = Table("role", "driver", "state", box=None, pad_edge=False, title=str(lab.path))
    table.title_justify = "left"
    for role in roles:
        fine = role.simulated and role.ok
        state = f"[magenta]{role.state}[/]" if fine else _state_markup(role.state, role.ok)
        table.add_row(role.role, role.driver, state)
    console.print(table)
    console.print()
    table = Table("driver", "for", "wire", box=None, pad_edge=False)
    table.add_column("state", overflow="fold")
    before = ""
    for driver in drivers:
        kind, before = driver.kind if driver.kind != before else "", driver.kind
        table.add_row(driver.driver, kind, driver.wire, _state_markup(driver.state, driver.ok))
    console.print(table)
    console.print("\n[dim]whether they work: visavis devices test ROLE[/]")


@devices_app.command("test")
def listen(
    roles: RolesArgument = None,
    seconds: SecondsOption = 10.0,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Listen to devices for ten seconds: rate, gaps, jitter, delay, clock.

    Example: visavis devices test eye_tracker
    """
    lab = load_lab(config, quiet=as_json)
    _check_seconds(seconds)
    connections = [_device(lab, role) for role in roles] if roles else list(lab.devices.values())
    devices, prepare = with_their_headset(lab, connections), shown_pictures(lab)
    if as_json:
        trials = capture(devices, SystemClock(), seconds, prepare=prepare)[-len(connections) :]
        say_json([asdict(t) for t in trials])
    else:
        with console.status(f"listening for {seconds:g} s") as status:
            trials = capture(
                devices,
                SystemClock(),
                seconds,
                prepare=prepare,
                tick=lambda passed_s: status.update(f"listening: {passed_s:.0f} of {seconds:g} s"),
            )
        trials = trials[-len(connections) :]
        print_trials(trials)
    if any(trial.error for trial in trials):
        raise typer.Exit(DeviceError.exit_code)


@devices_app.command()
def identify(role: RoleArgument, config: ConfigOption = None) -> None:
    """Buzz one armband three times, to see which arm it is on.

    Example: visavis devices identify armband_left_forearm
    """
    lab = load_lab(config)
    bands = [name for name in lab.devices if name.startswith("armband_")]
    if role not in bands:
        hint = did_you_mean(role, bands)
        band_names = ", ".join(bands) or "none: add one under devices in the configuration"
        raise UsageError(
            f"{role!r} is not an armband of {lab.path}{hint or '.'} Its armbands: {band_names}"
        )
    message = buzz(_device(lab, role), SystemClock())
    say(message)


@devices_app.command("setup")
def set_up_device(role: RoleArgument, config: ConfigOption = None) -> None:
    """Set a device up in its own way: an EyeLink's camera, with targets on this screen.

    Example: visavis devices setup eye_tracker
    """
    device = _device(load_lab(config), role)
    wiring = driver_wiring(device.driver)
    if wiring.set_up is None:
        raise UsageError(f"{role} ({device.driver}) has nothing to set up from here")
    if device.simulated:
        raise UsageError(f"{role} is simulated, and simulated devices need no set-up")
    options = wiring.spec.checked_options(role, device.options)
    say(wiring.set_up(Site(wiring.spec, role, SystemClock(), options)))


@devices_app.command("luminance")
def measure_luminance(
    file: Annotated[
        Path | None,
        typer.Argument(help="A table with level and cd_m2; left out: each level is shown."),
    ] = None,
    levels: Annotated[
        int, typer.Option(min=MIN_LEVELS, max=WHITE + 1, help="How many levels are shown.")
    ] = 17,
    guns: Annotated[
        bool, typer.Option("--guns", help="Red, green and blue by themselves, too.")
    ] = False,
    replaces: Annotated[
        bool, typer.Option("--replace", help="Take the place of an earlier table.")
    ] = False,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the screen's luminances by a photometer; greys and contrasts are then of light.

    Each level fills the participant's screen; type what the photometer says, in cd/m². The table
    is written beside the configuration, where `plan`, `run` and `simulate` find it. Whoever stops
    in between can go on from there the next time.

    Example: visavis devices luminance
    """
    # late: it loads pandas, which the other commands on devices do without
    from visavis.cli.luminance_sheet import Draft, print_fit, typed_luminances, write_table

    lab = load_lab(config, quiet=as_json)
    screen, path = lab.display.on_screen, lab.luminance_path
    if screen is None:
        raise UsageError(
            f"{lab.path} describes no screen; luminances are measured of a monitor under "
            "display.screen (docs/screens.md)"
        )
    if path.exists() and not replaces:
        raise UsageError(f"{path} is there already; to measure anew give --replace")
    draft = Draft(path.with_suffix(".partial.csv"), screen.identity)
    if file is not None:
        rows = read_luminance(file, screen.identity).rows
    elif lab.display.show != "screen":
        raise UsageError(
            f"{lab.path}: display.show is {lab.display.show}, so nothing can be shown; set it to "
            "screen, or give a file of luminances"
        )
    else:
        rows = typed_luminances(screen, draft, levels, guns=guns)
    luminance_table(rows, screen.identity, "")  # raises before anything is written
    write_table(rows, screen.identity, path)
    if file is None:
        draft.path.unlink(missing_ok=True)
    table = read_luminance(path, screen.identity)
    if as_json:
        fits = {curve.gun: asdict(curve.fit) for curve in table.curves}
        say_json({"file": path, **table.as_entry(), "fits": fits})
        return
    print_fit(table)
    say_written(path)


@devices_app.command("rules")
def print_rules(
    config: ConfigOption = None,
    install: Annotated[
        bool, typer.Option("--install", help="Write them to /etc/udev (as root) and load them.")
    ] = False,
) -> None:
    """Print the udev rules that let you use the lab's serial, HID and USB devices on Linux.

    Example: visavis devices rules
    """
    rules = access_rules(load_lab(config).devices)
    for note in rules.notes:
        typer.echo(f"# {note}", err=True)
    if not install:
        typer.echo(rules.text, nl=False)
        return
    install_rules(rules.text, Path(RULES_PATH))
    console.print(f"{RULES_PATH} is in force; unplug the devices and plug them in again")


def install_rules(text: str, path: Path) -> None:
    """Write rules and let udev read them; raises UsageError where this may not be done."""
    udevadm = shutil.which("udevadm")
    if udevadm is None:
        raise UsageError("this computer has no udev; rules are for Linux with udev alone")
    try:
        path.write_text(text, "utf-8")
    except OSError as problem:
        raise UsageError(
            f"{path} cannot be written ({problem.strerror}); run: "
            f"visavis devices rules | sudo tee {path} && sudo udevadm control --reload"
        ) from problem
    reload = subprocess.run(  # noqa: S603 - a command of the system
        [udevadm, "control", "--reload"], capture_output=True, text=True, check=False
    )
    if reload.returncode:
        raise UsageError(
            f"{path} is written, but udev did not read it ({reload.stderr.strip()}); restart the "
            "computer"
        )


@devices_app.command("capture")
def capture_wire(
    role: RoleArgument,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="The .wire file to write; ROLE.wire.")
    ] = None,
    seconds: SecondsOption = 10.0,
    config: ConfigOption = None,
) -> None:
    """Write what crosses a device's wire to a file that can be played back and sent on.

    Example: visavis devices capture eye_tracker -o eyes.wire
    """
    lab = load_lab(config)
    _check_seconds(seconds)
    device = _device(lab, role)
    path = output if output is not None else Path(f"{role}.wire")
    if path.exists():
        raise UsageError(f"{path} exists already; it was left as it is: give another with -o")
    if not path.parent.is_dir():
        raise UsageError(f"there is no folder {path.parent}; make it first")
    clock = SystemClock()
    wires = CapturedWires(role, path, clock, note_of(device))
    with console.status(f"capturing for {seconds:g} s"):
        devices = with_their_headset(lab, [device])
        trials = capture(devices, clock, seconds, wires=wires, prepare=shown_pictures(lab))[-1:]
    wires.end()
    if not trials[0].error and not wires.is_captured:
        raise UsageError(
            f"{role}: {device.driver} has no wire that could be captured here; drivers of other "
            "packages keep captures themselves, those of Visavis with a wire are captured "
            "(see `visavis devices list`)"
        )
    print_trials(trials)
    if trials[0].error:
        raise typer.Exit(DeviceError.exit_code)
    size_kb = path.stat().st_size / 1000
    say(
        f"wrote [b]{verbatim(path)}[/] ({size_kb:.0f} kB); play it back: "
        f"visavis devices replay {verbatim(path)}"
    )


@devices_app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A .wire file written by `devices capture`.")],
    driver: Annotated[
        str | None, typer.Option("--driver", help="Its driver, for files that do not name it.")
    ] = None,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Play a captured wire through the same driver, at once, without any device.

    Example: visavis devices replay eyes.wire
    """
    if not file.is_file():
        raise UsageError(f"there is no file {file}; write one with `visavis devices capture ROLE`")
    try:
        log = read_wire_log(file)
        device = device_of(file, log, driver)
    except DataError as wrong:  # the fault is in the file the user gave, not in our recordings
        raise UsageError(str(wrong)) from wrong
    clock = SimClock()
    wires = ReplayedWires(file, clock)

    def is_over() -> bool:
        return wires.playing is not None and wires.playing.is_finished

    raw_trials = capture([device], clock, MAX_S, wires=wires, is_over=is_over)
    trials = tuple(_as_recorded(trial, simulated=log.is_simulated) for trial in raw_trials)
    if as_json:
        say_json([asdict(t) for t in trials])
    else:
        print_trials(trials)
        say("[dim]the whole wire, from opening to closing; `capture` counts only what it hears[/]")
    if trials[0].error:
        raise typer.Exit(DeviceError.exit_code)


def _as_recorded(trial: "Trial", *, simulated: bool) -> "Trial":
    """Return the trial without the faults that only the playback causes.

    On playback the driver does not send the commands that closed the recorded connection, so some
    of its other commands get no answer.
    """
    faults = tuple(fault for fault in trial.faults if UNANSWERED_TEXT not in fault.message)
    return replace(trial, simulated=simulated, faults=faults)


def _device(lab: LabConfig, role: str) -> DeviceConfig:
    if role in lab.devices:
        return lab.devices[role]
    hint = did_you_mean(role, lab.devices)
    role_names = ", ".join(lab.devices)
    raise UsageError(f"{lab.path} has no role {role!r}{hint or '.'} Its roles: {role_names}")


def _check_seconds(seconds: float) -> None:
    if not 0.5 <= seconds <= MAX_S:
        raise UsageError(f"--seconds takes 0.5 to {MAX_S:g}, not {seconds:g}")


def _state_markup(text: str, ok: bool | None) -> str:
    if ok is None:
        return f"[dim]{escape(text)}[/]"
    return f"[green]{escape(text)}[/]" if ok else f"[yellow]{escape(text)}[/]"

"""Print the results of a capture, device by device."""

from collections.abc import Sequence

from rich.markup import escape

from visavis.cli.app import say, verbatim
from visavis.devices.bench import Trial
from visavis.devices.contracts import Fault
from visavis.devices.stream_figures import ClockFigures, StreamFigures

NAME_WIDTH = 14
FAR_FROM_NOMINAL_01 = 0.05


def print_trials(trials: Sequence[Trial]) -> None:
    """Print streams, clocks and faults; devices that never streamed come last."""
    for trial in trials:
        if not trial.error:
            _print_streaming(trial)
    if any(s.delay_ms is not None and not s.delay_is_absolute for t in trials for s in t.streams):
        say("[dim]≥: above the quickest sample, as the device answers no time requests[/]")
    for trial in trials:
        if trial.error:
            who = f"[b]{verbatim(trial.role)}[/] ({verbatim(trial.driver)})"
            say(f"[red]✗[/] {who}: {escape(trial.error)}")
            _advise(trial.remedy)


def _print_streaming(trial: Trial) -> None:
    who = trial.driver
    if trial.info is not None:
        names = (trial.info.vendor, trial.info.model, trial.info.serial)
        device_name = " ".join(name for name in names if name and name != "simulated")
        who = f"{trial.driver}: {device_name}"
    mark = "  [magenta]simulated[/]" if trial.simulated else ""
    say(f"[b]{verbatim(trial.role)}[/]  {escape(who)}{mark}")
    for stream in trial.streams:
        for number, line in enumerate(_lines(stream)):
            say(_named(stream.stream if not number else "", line))
    if trial.clock is not None:
        say(_named("clock", _clock(trial.clock)))
    if trial.health is not None and trial.health.battery_01 is not None:
        say(_named("battery", f"{trial.health.battery_01:.0%}"))
    for event in trial.events:
        say(f"  [yellow]![/] {escape(event)}")
    for fault in trial.faults:
        _print_fault(fault)


def _named(name: str, line: str) -> str:
    """Return a line with its name before it; a long name still ends before the line begins."""
    return f"  {name:<{NAME_WIDTH - 1}} {line}"


def _print_fault(fault: Fault) -> None:
    colour = "red" if fault.severity == "blocking" else "yellow"
    say(f"  [{colour}]![/] {escape(fault.message)}")
    _advise(fault.remedy, indent=4)


def _advise(remedy: str, indent: int = 2) -> None:
    if remedy:
        say(f"{' ' * indent}→ {escape(remedy)}")


def _lines(s: StreamFigures) -> list[str]:
    if not s.nominal_rate_hz:
        return [f"{s.samples} rows (whenever something happens)"]
    if not s.samples:
        return [f"[red]nothing came[/], expected {s.nominal_rate_hz:g} a second"]
    rate = "rate unknown"
    if s.rate_hz is not None:
        rate = f"{s.rate_hz:.1f} Hz"
        if abs(s.rate_hz / s.nominal_rate_hz - 1) > FAR_FROM_NOMINAL_01:
            rate = f"[yellow]{rate} instead of {s.nominal_rate_hz:g}[/]"
    gaps = f"[yellow]{s.gaps} gaps[/]" if s.gaps else "no gaps"
    lost_text = f", [yellow]{s.lost} lost[/]" if s.lost else ""
    longest = "" if s.longest_gap_ms is None else f", longest spacing {s.longest_gap_ms:.1f} ms"
    lines = [f"{s.samples} samples, {rate}, {gaps}{lost_text}{longest}"]
    if s.jitter_ms is not None and s.delay_ms is not None and s.delay_p99_ms is not None:
        sign = "" if s.delay_is_absolute else "≥ "
        lines.append(
            f"jitter {s.jitter_ms:.2f} ms, delay {sign}{s.delay_ms:.2f} ms, "
            f"99 % within {sign}{s.delay_p99_ms:.2f} ms"
        )
    return lines


def _clock(clock: ClockFigures) -> str:
    spread = "" if clock.residual_ms is None else f", spread {clock.residual_ms:.3f} ms"
    drift = "too short to know the drift"
    if clock.drift_ppm is not None:
        drift = f"drift {clock.drift_ppm:+.1f} ppm{spread}"
    if clock.bound_ms is None:
        return f"one-way, {drift}"
    return f"offset ±{clock.bound_ms:.2f} ms ({clock.exchanges} exchanges), {drift}"

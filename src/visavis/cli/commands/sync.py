"""sync-test: measure delay and jitter of picture, sound and vibration in this room."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress
from rich.table import Table

from visavis.analysis.frame_times import PoseAge
from visavis.analysis.gaze_delay import MIN_LATENCY_MS, GazeDelayBound
from visavis.analysis.sync_test import Delays, offsets_ms
from visavis.cli.app import ConfigOption, JsonOption, app, console, load_lab, say_json, verbatim
from visavis.cli.sync_chain import (
    AUDIO_CHANNELS,
    DEFAULT_CHANNELS,
    gaze_bound_of,
    pace_of,
    perform_real,
    perform_simulated,
    pose_age_of,
)
from visavis.cli.sync_records import FOLDER
from visavis.devices.sim.sync_room import PlantedDelay
from visavis.lab.clock import SystemClock
from visavis.lab.config import LabConfig
from visavis.lab.errors import UsageError
from visavis.recording.journal import as_json as json_of

SIMULATED_PICTURE, SIMULATED_SOUND = (9.0, 1.0), (22.0, 3.0)
SIMULATED_GAZE_DELAY_MS = 12.0


@app.command("sync-test")
def sync_test(
    sensor: Annotated[
        str,
        typer.Option(help="The board's port; audio or audio:INPUT; role:ROLE of an LSL stream."),
    ] = "",
    speaker: Annotated[
        str, typer.Option(help="A sound output, or default; no clicks when left out.")
    ] = "",
    band: Annotated[str, typer.Option(help="Role of the band that buzzes; none when left out.")] = (
        ""
    ),
    eyes: Annotated[
        str, typer.Option(help="Role of the eye tracker whose delay is bounded; none left out.")
    ] = "",
    artificial_eye: Annotated[
        bool, typer.Option("--artificial-eye", help="The eye moves with the light, at once.")
    ] = False,
    light: Annotated[str, typer.Option(help="Channel of the photodiode, or none.")] = "",
    sound: Annotated[str, typer.Option(help="Channel of the microphone, or none.")] = "",
    motion: Annotated[str, typer.Option(help="Channel of the accelerometer, or none.")] = "",
    repeats: Annotated[int, typer.Option(min=10, max=2000, help="Stimuli of each kind.")] = 60,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="Rehearse in a simulated room.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the simulated room.")] = 1,
    config: ConfigOption = None,
    as_json: JsonOption = False,
) -> None:
    """Measure how late picture, sound and vibration are here: delay, jitter, drift, lost frames.

    Example: visavis sync-test --sensor /dev/ttyACM0 --speaker default --band armband_left
    """
    lab = load_lab(config, quiet=as_json)
    if simulated == bool(sensor):
        raise UsageError("say --sensor (the board's port, audio, role:ROLE), or --simulated")
    usual = AUDIO_CHANNELS if sensor.startswith("audio") else DEFAULT_CHANNELS
    channel_options = {"picture": light, "sound": sound, "vibration": motion}
    # Only the channels this kind of sensor has; an option replaces its usual number.
    channels = {name: channel_options[name] or usual[name] for name in usual}
    clock = SystemClock()
    with Progress(console=console, transient=True, disable=as_json) as bar:
        task = bar.add_task("flash, click, buzz", total=repeats)

        def progress(count: int) -> None:
            bar.update(task, completed=count)

        if simulated:
            delays, stimuli, sensor_device, _ = perform_simulated(
                seed=seed,
                repeats=repeats,
                picture=PlantedDelay(*SIMULATED_PICTURE),
                sound=PlantedDelay(*SIMULATED_SOUND),
                lab=lab,
                gaze_delay_ms=SIMULATED_GAZE_DELAY_MS if eyes else None,
                progress=progress,
            )
        else:
            delays, stimuli, sensor_device = perform_real(
                lab,
                clock,
                sensor_name=sensor,
                speaker_name=speaker,
                band_role=band,
                channels=channels,
                repeats=repeats,
                progress=progress,
                eyes_role=eyes,
            )
    age, pace = pose_age_of(stimuli, delays), pace_of(stimuli)
    least_ms = 0.0 if artificial_eye else MIN_LATENCY_MS
    bound = gaze_bound_of(stimuli, delays, eyes, min_latency_ms=least_ms) if eyes else None
    # The record goes to one file: the doctor reads its age, and analyse its offsets.
    content = {
        "made": clock.wall_iso(),
        "lab": lab.lab,
        "is_simulated": simulated,
        "sensor": sensor_device.display_name,
        "samples_lost": sensor_device.loss_count(),
        "frames": stimuli.frames,
        "frames_dropped": stimuli.dropped_frames,
        "frame_ms": stimuli.frame_ns / 1e6,
        "offsets_ms": offsets_ms(delays),
        "pose_age": age,
        "pace": asdict(pace) | {"warnings": pace.sentences},
        "gaze_delay": bound,
        "delays": delays,
    }
    record: dict[str, Any] = json_of(content)
    path = _keep(lab, record, delays)
    if as_json:
        say_json(record | {"path": str(path)})
        return
    _tell(record, delays, path)
    _tell_heads(age)
    for sentence in pace.sentences:
        console.print(f"[yellow]{sentence}.[/]")
    if bound is not None:
        _tell_gaze(bound, lab)


def _tell_heads(age: PoseAge) -> None:
    if not age.frames:
        return
    by = "the runtime's stamps"
    if age.picture_delay_ms == age.picture_delay_ms:
        by += " and the photodiode"
    console.print(
        f"pose age at the light: {age.at_least_ms:.1f} to {age.at_most_ms:.1f} ms, by {by} "
        f"(the head is foreseen by {age.look_ahead_ms:.1f} ms)"
    )


def _tell_gaze(bound: GazeDelayBound, lab: LabConfig) -> None:
    options = lab.devices[bound.role].options if bound.role in lab.devices else {}
    configured_ms = options.get("gaze_delay_ms")
    stated = "not given, so 0 is assumed" if configured_ms is None else f"{configured_ms:g} ms"
    if not bound.is_known:
        console.print(
            f"[yellow]No bound on {verbatim(bound.role)}'s delay: {bound.answer_count} of "
            f"{bound.target_count} saccades were seen. Look at each spot as soon as it appears, "
            "after a "
            "calibration.[/]"
        )
        return
    console.print(
        f"gaze delay of {verbatim(bound.role)}: at most {bound.at_most_ms:.1f} ms, by "
        f"{bound.answer_count} saccades; gaze_delay_ms as configured: {stated}"
    )
    if configured_ms is not None and configured_ms > bound.at_most_ms:
        console.print("[yellow]What is configured is more than saccades allow: check it.[/]")


def _keep(lab: LabConfig, record: dict[str, Any], delays: Sequence["Delays"]) -> Path:
    folder = lab.data_root / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    stamp = "".join(c for c in str(record["made"])[:19] if c.isdigit() or c == "T")
    mark = "simulated-" if record["is_simulated"] else ""
    number = 1
    while True:
        path = folder / f"sync-{stamp}-{mark}{number}.json"
        try:
            with path.open("x", encoding="utf-8") as file:  # nothing is overwritten
                json.dump(record, file, ensure_ascii=False, indent=1)
        except FileExistsError:
            number += 1
            continue
        break
    _draw(path.with_suffix(".png"), delays, is_simulated=bool(record["is_simulated"]))
    return path


def _draw(path: Path, delays: Sequence["Delays"], *, is_simulated: bool) -> None:
    from matplotlib.figure import Figure

    plotted_delays = [one for one in delays if one.answered]
    if not plotted_delays:
        return
    figure = Figure(figsize=(7, 2.2 * len(plotted_delays)), layout="constrained")
    axes = figure.subplots(len(plotted_delays), 2, squeeze=False, width_ratios=(1, 1.6))
    for (left, right), one in zip(axes, plotted_delays, strict=True):
        left.hist(one.delays_ms, bins=20, color="0.35")
        left.axvline(one.median_ms, color="tab:red", linewidth=1)
        left.set(xlabel="delay (ms)", ylabel="stimuli", title=f"{one.modality}, {one.source}")
        right.plot(one.delays_ms, ".", color="0.35", markersize=4)
        right.set(xlabel="stimulus", ylabel="delay (ms)")
    if is_simulated:
        figure.suptitle("SIMULATED room, not a measurement", color="tab:red")
    figure.savefig(path, dpi=120)


def _tell(record: dict[str, Any], delays: Sequence["Delays"], path: Path) -> None:
    if record["is_simulated"]:
        console.print("[magenta]SIMULATED room: these are no delays of this lab.[/]")
    table = Table("", "answered", "median", "jitter (SD)", "5 to 95 %, ms", "drift", box=None)
    for one in delays:
        drift = f"{one.drift_ms_per_min:+.2f} ms/min"
        if one.drift_low_ms_per_min <= 0 <= one.drift_high_ms_per_min:
            drift = "none seen"
        sound = one.is_sound
        table.add_row(
            one.modality,
            f"{one.answered} of {one.asked}",
            f"{one.median_ms:.2f} ms" if sound else "too few",
            f"{one.sd_ms:.2f} ms" if sound else "",
            f"{one.p5_ms:.2f} to {one.p95_ms:.2f}" if sound else "",
            drift if sound else "",
        )
    console.print(table)
    wrong = sum(one.shown_wrong for one in delays)
    console.print(
        f"frames: {record['frames']}, dropped {record['frames_dropped']}; flashes of a wrong "
        f"length {wrong}; samples lost {record['samples_lost']}"
    )
    for name, delay_ms in record["offsets_ms"].items():
        console.print(f"  {verbatim(name)}: {delay_ms:g}")
    missing_modalities = [one.modality for one in delays if not one.is_sound]
    if missing_modalities:
        console.print(
            f"[yellow]No offset for {', '.join(missing_modalities)}: fewer than 80 % were "
            "answered. Put the sensor nearer, turn the volume or its gain up, darken the room.[/]"
        )
    console.print(f"kept as {verbatim(path)} and .png")

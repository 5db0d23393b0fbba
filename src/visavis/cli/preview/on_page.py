"""What a participant sees of a trial on a page: a simulated visitor watches and answers."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from rich.progress import Progress

from visavis.cli.app import console, say_written
from visavis.cli.film.on_page import page_pictures, write_page_film
from visavis.cli.preview.capture import Capture
from visavis.cli.preview.pictures import SIMULATED, add_label, contact_sheet
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import UsageError
from visavis.results.opened_study import OpenedStudy

COLUMNS, ROWS = 3, 2


def preview_page(
    capture: Capture,
    study: OpenedStudy,
    label: str,
    size_px: tuple[int, int],
    png: Path | None,
    sheet: Path | None,
    video: Path | None,
    at_s: float | None,
    most_s: float,
    rate_hz: int,
) -> None:
    """Write a picture at `at_s` (None: in its middle), a sheet or a film of a trial's page.

    Raises:
        UsageError: the trial does not last so long.
        StageError: nothing draws here.
    """
    path = png or sheet or video
    assert path is not None  # noqa: S101  # the command has asked for one

    def once(start_ns: int, end_ns: int) -> Sequence[int]:
        if at_s is None:
            return [(start_ns + end_ns) // 2]
        if at_s * NS_PER_S >= end_ns - start_ns:
            length_s = (end_ns - start_ns) / NS_PER_S
            raise UsageError(f"--at {at_s} s: the trial lasts {length_s:.1f} s")
        return [start_ns + round(at_s * NS_PER_S)]

    def spread(start_ns: int, end_ns: int) -> Sequence[int]:
        times: list[int] = np.linspace(start_ns, end_ns - 1, COLUMNS * ROWS).astype(int).tolist()
        return times

    trial_id = capture.trial.trial_id
    with ExitStack() as stack:
        # Draw while the recording exists; it goes with the end of the block.
        with console.status("performing the trial"):
            recording = stack.enter_context(capture.on_page())
        bar = stack.enter_context(Progress(console=console, transient=True))
        drawing = bar.add_task("drawing", total=None)
        if video is not None:
            write_page_film(
                study,
                recording,
                trial_id,
                video,
                size_px=size_px,
                rate_hz=rate_hz,
                seconds=most_s,
                on_frame=lambda k, n: bar.update(drawing, completed=k, total=n),
            )
        else:
            tiles = []
            times_of = once if png is not None else spread
            for s, image, n in page_pictures(study, recording, trial_id, times_of, size_px):
                tiles.append(add_label(image, f"{SIMULATED}  ·  {label}, {s:.1f} s"))
                bar.update(drawing, completed=len(tiles), total=n)
            if png is not None:
                tiles[0].save(path)
            else:
                contact_sheet(tiles, f"{label}  ·  {SIMULATED}", COLUMNS).save(path)
    say_written(path)

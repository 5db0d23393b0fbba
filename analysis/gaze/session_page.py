"""The page on the quality of one session's gaze, as HTML."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from visavis.analysis.gaze.movements.detect import DETECTOR_NAMES
from visavis.analysis.gaze.movements.kinds import Movement
from visavis.analysis.gaze.pupil import LIGHT_IS_A_CONFOUND
from visavis.analysis.gaze.pupil_blinks import SOURCE
from visavis.analysis.gaze.session_quality import SessionQuality, blinks_a_minute
from visavis.analysis.own_streams import OwnStream, figures_of_streams, streams_section
from visavis.analysis.plots import svg_for_page
from visavis.analysis.report import (
    Column,
    Facts,
    Page,
    Paragraph,
    Picture,
    Section,
    Table,
    write_page,
)
from visavis.analysis.report.notation import decimal, percentage
from visavis.lab.clock import NS_PER_MS

PAGE_NAME: Final = "gaze_quality.html"
_MOMENTS = {"block_start": "before block", "end": "at the end"}


def write_session_page(
    quality: SessionQuality, path: Path, streams: Sequence[OwnStream] = ()
) -> Path:
    """Write the page and return its path; the same session gives the same bytes.

    `streams` are those of the lab's own devices, shown below the gaze.
    """
    page = session_page(quality)
    return write_page(replace(page, sections=(*page.sections, *_own_devices(streams))), path)


def write_streams_page(streams: Sequence[OwnStream], study: str, path: Path) -> Path:
    """Write the page of a session without gaze: its own devices alone; return its path."""
    of = streams[0]
    page = Page(
        title=f"Devices of {of.participant}, session {of.session}",
        subtitle=f"What the lab's own devices recorded; study {study}",
        facts=Facts(stream_facts(streams)),
        is_simulated=of.is_simulated,
        sections=_own_devices(streams),
    )
    return write_page(page, path)


def stream_facts(streams: Sequence[OwnStream]) -> tuple[tuple[str, str], ...]:
    """Return a line per stream of the lab's own devices."""
    return tuple((s.name, f"{s.rows} samples, {decimal(s.rate_hz, 1)} Hz") for s in streams)


def _own_devices(streams: Sequence[OwnStream]) -> tuple[Section, ...]:
    if not streams:
        return ()
    figures = figures_of_streams(streams)
    pictures = [Picture(svg_for_page(d), d.title, d.caption, d.alternative) for d in figures]
    return (streams_section(streams, pictures),)


def session_page(quality: SessionQuality) -> Page:
    """Return the page: validations, loss and precision by eye, latency, movements, pupil."""
    return Page(
        title=f"Gaze of {quality.participant}, session {quality.session}",
        subtitle=f"Data quality by the field's standard; study {quality.study}",
        facts=Facts(headline_facts(quality)),
        is_simulated=quality.is_simulated,
        sections=(
            Section("validations", "Accuracy and precision at targets", (_validations(quality),)),
            Section("eyes", "Loss, rate and precision over the session", (_eyes(quality),)),
            Section("latency", "Latency", _latency(quality)),
            Section("movements", "Eye movements", _movements(quality)),
            *(() if quality.pupil is None else (Section("pupil", "Pupil size", _pupil(quality)),)),
        ),
    )


def headline_facts(quality: SessionQuality) -> tuple[tuple[str, str], ...]:
    """Return the figures a paper states: names with values, in the order of the standard."""
    in_force = [v for v in quality.validations if v.accepted] or list(quality.validations)
    eye = quality.eyes[0] if quality.eyes else None
    return (
        ("Tracker", quality.tracker),
        ("Accuracy", _mean_deg([v.accuracy_deg for v in in_force])),
        ("Precision, RMS-S2S", _mean_deg([v.rms_s2s_deg for v in in_force])),
        ("Precision, STD", _mean_deg([v.std_deg for v in in_force])),
        ("Data loss", percentage(eye.loss.lost_01) if eye else "–"),
        ("Effective rate", f"{decimal(eye.loss.effective_rate_hz, 1)} Hz" if eye else "–"),
        ("Stated rate", f"{decimal(quality.nominal_rate_hz, 1)} Hz"),
        ("Latency to the display", f"{decimal(quality.latency.shown_ms, 1)} ms"),
    )


def _mean_deg(values: list[float]) -> str:
    finite = [v for v in values if np.isfinite(v)]
    return f"{decimal(float(np.mean(finite)), 2)}°" if finite else "–"


def _validations(quality: SessionQuality) -> Table | Paragraph:
    if not quality.validations:
        return Paragraph("No validation was recorded: accuracy is unknown.")
    return Table(
        tuple(
            Column(head, "left" if not n else "right")
            for n, head in enumerate(
                (
                    "Validation",
                    "Accuracy (°)",
                    "Worst target (°)",
                    "RMS-S2S (°)",
                    "STD (°)",
                    "Loss",
                    "Accepted",
                )
            )
        ),
        tuple(
            (
                f"{_MOMENTS.get(v.moment, v.moment)}"
                + (f" {v.block + 1}" if v.moment == "block_start" else ""),
                decimal(v.accuracy_deg, 2),
                decimal(v.worst_point_deg, 2),
                decimal(v.rms_s2s_deg, 2),
                decimal(v.std_deg, 2),
                percentage(v.lost_01),
                "yes" if v.accepted else "no",
            )
            for v in quality.validations
        ),
        "Validations, combined eye",
        "Accuracy is the angle from a target to the mean direction, precision the spread while "
        "the target was looked at; means over targets.",
    )


def _eyes(quality: SessionQuality) -> Table:
    heads = (
        "Eye",
        "Rows",
        "Usable",
        "Loss",
        "Loss by rows",
        "Rate (Hz)",
        "Effective rate (Hz)",
        "Longest gap (ms)",
        "RMS-S2S (°)",
        "RMS-S2S, calmest (°)",
        "STD (°)",
    )
    return Table(
        tuple(Column(head, "right" if n else "left") for n, head in enumerate(heads)),
        tuple(
            (
                e.eye,
                str(e.loss.rows),
                str(e.loss.usable),
                percentage(e.loss.lost_01),
                percentage(e.loss.invalid_rows_01),
                decimal(e.loss.rate_hz, 1),
                decimal(e.loss.effective_rate_hz, 1),
                decimal(e.loss.longest_gap_ms, 0),
                decimal(e.rms_s2s_median_deg, 3),
                decimal(e.rms_s2s_calmest_deg, 3),
                decimal(e.std_median_deg, 3),
            )
            for e in quality.eyes
        ),
        "The whole session, by eye",
        "Loss counts rows that never came, too. Precision is the median over windows of 200 ms "
        "of free viewing, so saccades are in it; the calmest window is nearest to the tracker's.",
    )


def _latency(quality: SessionQuality) -> tuple[Table, Paragraph]:
    of = quality.latency
    rows = (
        ("handed to the session", of.handed_over_ms, of.handed_over_p95_ms),
        ("due on the display", of.shown_ms, of.shown_p95_ms),
    )
    return (
        Table(
            (
                Column("Age of a sample when"),
                Column("Median (ms)", "right"),
                Column("95th percentile (ms)", "right"),
            ),
            tuple((name, decimal(a, 1), decimal(b, 1)) for name, a, b in rows),
            "From the sample's time stamp",
        ),
        Paragraph(
            "What the tracker takes from the eye to its time stamp is not known and not in these; "
            "take it from the maker or measure it, and configure it as gaze_delay_ms."
            if quality.gaze_delay_ms is None
            else f"The tracker's own delay, {decimal(quality.gaze_delay_ms, 1)} ms as configured "
            "(gaze_delay_ms), is taken off every sample's time and so in these ages."
        ),
    )


def _movements(quality: SessionQuality) -> tuple[Paragraph, Table]:
    m = quality.movements
    duration_ms = m.duration_ns / NS_PER_MS
    kinds = [k for k in Movement if k != Movement.UNKNOWN]
    return (
        Paragraph(
            f"Detector: {DETECTOR_NAMES[m.detector]} ({m.why}). "
            f"Blinks a minute: {decimal(blinks_a_minute(quality), 1)}."
        ),
        Table(
            (
                Column("Movement"),
                Column("Number", "right"),
                Column("Share of samples", "right"),
                Column("Median duration (ms)", "right"),
                Column("Median amplitude (°)", "right"),
            ),
            tuple(
                (
                    kind.name.lower(),
                    str(int((m.kind == kind).sum())),
                    percentage(m.share_01(kind)),
                    decimal(_median(duration_ms[m.kind == kind]), 0),
                    decimal(_median(m.amplitude_deg[m.kind == kind]), 2),
                )
                for kind in kinds
            ),
            "Eye movements found",
        ),
    )


def _median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else np.nan


def _of_pupil_blinks(quality: SessionQuality) -> str:
    blinks = quality.pupil_blinks
    duration_ms = quality.eyes[0].loss.duration_ms if quality.eyes else 0.0
    if blinks is None or not duration_ms:
        return ""
    median = f" of {decimal(_median(blinks.duration_ms), 0)} ms in the middle" if blinks else ""
    return (
        f" By the pupil itself, edges of the lid included: {len(blinks)} blinks{median}, "
        f"{decimal(len(blinks) * 60_000 / duration_ms, 1)} a minute, and {blinks.losses} longer "
        f"losses ({SOURCE})."
    )


def _pupil(quality: SessionQuality) -> tuple[Paragraph, ...] | tuple[Paragraph, Table, Paragraph]:
    pupil = quality.pupil
    if pupil is None:
        return ()
    median = _median(pupil.diameter_mm)
    summary = Paragraph(
        f"Median {decimal(median, 2)} mm; measured in {percentage(pupil.measured_01)} of rows, "
        f"{percentage(pupil.bridged_01)} bridged in {pupil.blinks} stretches; foreshortening by "
        f"the angle of gaze undone.{_of_pupil_blinks(quality)}"
    )
    return (
        summary,
        Table(
            tuple(
                Column(head, "right" if n else "left")
                for n, head in enumerate(
                    ("Trial", "Baseline (mm)", "Change (mm)", "Peak (mm)", "Known", "Bridged")
                )
            ),
            tuple(
                (
                    t.trial_id,
                    decimal(t.response.baseline_mm, 2),
                    decimal(t.response.change_mm, 2),
                    decimal(t.response.peak_mm, 2),
                    percentage(t.response.known_01),
                    percentage(t.response.bridged_01),
                )
                for t in quality.pupil_trials
            ),
            "Pupil size in finished trials against the 200 ms before",
        ),
        Paragraph(LIGHT_IS_A_CONFOUND),
    )

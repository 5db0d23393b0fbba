"""Check a session before the participant leaves: compare its plan with its recording.

Every threshold is an argument with a default: a trial is out above 30 % of lost gaze, a validation
is accepted up to 1.5° (docs/gaze.md, "Quality").
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from visavis.analysis.frame_times import runtime_pace
from visavis.analysis.session_incidents import reason_words
from visavis.analysis.session_verdict import (
    RESUME,
    CheckLimits,
    Finding,
    Level,
    SessionCheck,
    StreamCheck,
    TrialCheck,
)
from visavis.lab.clock import NS_PER_S
from visavis.lab.errors import DataError
from visavis.lab.luminance import LUMINANCE_KEY, NO_LUMINANCES, table_of_entry
from visavis.recording.integrity import damage_of
from visavis.recording.manifest import DESIGN_KEY, PRACTICE_UNTIL_KEY
from visavis.recording.reader import Recording
from visavis.stimuli.gaze_window import GAZE_WINDOW

RESTORE = "restore the damaged files from a copy; `visavis analyse` leaves damaged trials out"
REDO_BLOCK = (
    "look how the headset sits and validate again while they are here; redo the last block in a "
    "further session (`visavis run` with --session) where it rests on gaze"
)
OF_GREYS = ("Grating(", "Dots(", "Shape(")
"""How the event "shown" names the stimuli that are drawn in greys."""
UNNOTICED_MS = 60.0
"""Up to this delay people do not notice that what is around their gaze is blurred (Loschky &
Wolverton 2007)."""
Events: TypeAlias = Sequence[tuple[str, Mapping[str, Any]]]
"""Names and payloads of all events of a session, in written order."""
Rows: TypeAlias = Sequence[Mapping[str, Any]]
"""Rows of all trials that were performed, as written."""

_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def check_session(recording: Recording, limits: CheckLimits | None = None) -> SessionCheck:
    """Compare plan and recording of a session in any state.

    Raises:
        DataError: trials or events hold, under checksums that agree, what no session writes.
    """
    try:
        return _check(recording, limits or CheckLimits())
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise DataError(
            f"{recording.path}: its trials or events hold what no session of this Visavis writes "
            f"({type(error).__name__}: {error}); another program made or changed it: restore it "
            "from a copy"
        ) from error


def _check(recording: Recording, limits: CheckLimits) -> SessionCheck:
    plan: Mapping[str, Any] = recording.manifest.plan
    journals = [recording.journal(part.number) for part in recording.manifest.parts]
    events = [(str(e["name"]), e["payload"]) for journal in journals for e in journal.events]
    rows = [trial["row"] for journal in journals for trial in journal.trials]
    trials = _check_trials(plan, rows, events, limits)
    streams = _check_streams(recording, limits)
    findings = [
        *_recording_findings(recording),
        *_trial_findings(trials, _practice_trials(plan), is_calibrated=_plans_calibration(plan)),
        *(stream_findings(streams) if streams or not _is_on_page(recording) else ()),
        *_pace_findings(recording),
        *(() if _is_on_page(recording) else _calibration_findings(plan, events, limits)),
        *_luminance_findings(recording, events),
        *_window_findings(recording),
        *_questionnaire_findings(plan, events),
        *_deviation_findings(events, rows, recording),
    ]
    if recording.status == "running":  # there is nothing to redo yet
        findings = [f if f.subject == "recording" else replace(f, redo="") for f in findings]
    return SessionCheck(
        level=max((f.level for f in findings), default=Level.GREEN),
        is_simulated=recording.is_simulated,
        participant=recording.manifest.participant,
        findings=tuple(findings),
        trials=tuple(trials),
        streams=tuple(streams),
    )


# ---- the recording itself --------------------------------------------------------------------


def _recording_findings(recording: Recording) -> list[Finding]:
    status = recording.status
    if status == "running":
        return [
            Finding(
                Level.AMBER, "recording", "the session is still running", "wait for its last trial"
            )
        ]
    damage = damage_of(recording)
    findings = [
        Finding(Level.RED, "recording", text, RESTORE)
        for text in dict.fromkeys((*damage.summary(), *damage.problems))
    ]
    parts = recording.manifest.parts
    if not parts or parts[-1].status != "complete":
        is_aborted = bool(parts) and parts[-1].status == "aborted"
        findings.append(
            Finding(
                Level.RED,
                "recording",
                ("ended early" if is_aborted else "the session crashed")
                + _because(parts[-1].reason if parts else ""),
                RESUME,
            )
        )
    findings = findings or [
        Finding(Level.GREEN, "recording", "complete: every file closed and verified")
    ]
    return [*findings, *(Finding(Level.AMBER, "recording", note) for note in damage.notes)]


# ---- trials ----------------------------------------------------------------------------------


def _check_trials(
    plan: Mapping[str, Any], rows: Rows, events: Events, limits: CheckLimits
) -> list[TrialCheck]:
    n_starts: dict[str, int] = {}
    for payload in _payloads(events, "trial_start"):
        n_starts[payload["trial_id"]] = n_starts.get(payload["trial_id"], 0) + 1
    last: dict[str, Mapping[str, Any]] = {}
    for row in rows:
        earlier = last.get(str(row["trial_id"]))
        comes_again = row.get("status") in ("interrupted", "repeated")
        if earlier is None or not comes_again or earlier["status"] in ("interrupted", "repeated"):
            last[str(row["trial_id"])] = row
    return [
        _check_trial(trial, last.get(trial["trial_id"]), n_starts, limits)
        for block in plan.get("blocks", ())
        for trial in block["trials"]
    ]


def _check_trial(
    trial: Mapping[str, Any],
    row: Mapping[str, Any] | None,
    n_starts: Mapping[str, int],
    limits: CheckLimits,
) -> TrialCheck:
    trial_id = trial["trial_id"]
    attempts = n_starts.get(trial_id, 0)
    if row is None or row["status"] in ("interrupted", "repeated"):
        status = "interrupted" if attempts else "missing"
        return TrialCheck(
            trial_id, trial["block"], status, attempts, Level.RED, None, None, None, None, None, ""
        )
    n_expected, n_received, n_valid = (
        int(row[c]) for c in ("gaze_expected", "gaze_received", "gaze_valid")
    )
    level = Level.GREEN
    if n_expected:
        level = max(
            _share_level(n_received / n_expected, limits.received_amber_01, limits.received_red_01),
            _share_level(n_valid / n_expected, limits.valid_amber_01, limits.valid_red_01),
        )
    flags = str(row.get("flags") or "")
    return TrialCheck(
        trial_id,
        trial["block"],
        str(row["status"]),
        attempts,
        level,
        n_expected,
        n_received,
        n_valid,
        int(row["frames"]),
        int(row["frames_dropped"]),
        flags,
    )


def _share_level(share_01: float, amber_01: float, red_01: float) -> Level:
    if share_01 < red_01:
        return Level.RED
    return Level.AMBER if share_01 < amber_01 else Level.GREEN


def _trial_findings(
    trials: list[TrialCheck], practice: int, *, is_calibrated: bool
) -> list[Finding]:
    complete = sum(t.status == "complete" for t in trials)
    besides = f", {practice} of them practice" if practice else ""
    findings = [
        Finding(
            Level.GREEN if complete == len(trials) else Level.AMBER,
            "trials",
            f"{complete} of {len(trials)} planned trials complete{besides}",
        )
    ]
    open_trials = [t.trial_id for t in trials if t.status in ("missing", "interrupted")]
    if open_trials:
        findings.append(
            Finding(
                Level.RED,
                "trials",
                f"not done: {_name_list(open_trials)}",
                "continue with `visavis resume`; it performs the missing trials",
            )
        )
    skipped_trials = [t.trial_id for t in trials if t.status == "skipped"]
    if skipped_trials:
        findings.append(
            Finding(Level.AMBER, "trials", f"skipped with a reason: {_name_list(skipped_trials)}")
        )
    for level, word in ((Level.RED, "too little"), (Level.AMBER, "less than usual")):
        poor = [t.trial_id for t in trials if t.status == "complete" and t.gaze_level is level]
        if poor:
            words = f"{word} valid gaze in {_name_list(poor)}"
            if not is_calibrated:  # then no result rests on it, or another program calibrated
                words += "; gaze was not calibrated, so look whether anything rests on it"
                findings.append(Finding(min(level, Level.AMBER), "gaze", words))
                continue
            redo = "recalibrate, then redo these trials in a further session" if level > 1 else ""
            findings.append(Finding(level, "gaze", words, redo))
    flag_texts = [f"{t.trial_id} ({t.flags.replace(';', ', ')})" for t in trials if t.flags]
    if flag_texts:
        findings.append(Finding(Level.AMBER, "trials", f"flagged: {_name_list(flag_texts)}"))
    return findings


def _plans_calibration(plan: Mapping[str, Any]) -> bool:
    return any(block.get("calibrate") for block in plan.get("blocks", ()))


def _practice_trials(plan: Mapping[str, Any]) -> int:
    every = (trial for block in plan.get("blocks", ()) for trial in block["trials"])
    return sum(bool(trial.get("is_practice")) for trial in every)


def _name_list(names: list[str], most: int = 12) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


# ---- streams ---------------------------------------------------------------------------------


def _check_streams(recording: Recording, limits: CheckLimits) -> list[StreamCheck]:
    checks = []
    for name in recording.stream_names:
        arrays = recording.stream_arrays(name)
        schema = recording.stream_schema(name)  # known now: the file is not read again
        t_ns = arrays.get("t_host_ns", np.zeros(0, dtype=np.int64))
        parts = arrays["recording_part"]
        nominal_hz = schema.nominal_rate_hz if schema is not None else 0.0
        if nominal_hz <= 0:
            checks.append(StreamCheck(name, len(t_ns), None, None, None, Level.GREEN))
            continue
        duration_s = 0.0
        longest_ms = 0.0
        numbered = 0
        for part in np.unique(parts):
            seq = arrays["seq"][parts == part]
            numbered += int(seq[-1] - seq[0]) + 1
            times = t_ns[parts == part]
            duration_s += float(times[-1] - times[0]) / 1e9
            if len(times) > 1:
                longest_ms = max(longest_ms, float(np.diff(times).max()) / 1e6)
        # Somebody at a page may leave the headset and enter again: only numbers tell what is lost.
        n_expected = numbered if _is_on_page(recording) else round(duration_s * nominal_hz)
        share_01 = len(t_ns) / n_expected if n_expected else 0.0
        level = _share_level(share_01, limits.received_amber_01, limits.received_red_01)
        rate_hz = len(t_ns) / duration_s if duration_s > 0 else 0.0
        checks.append(StreamCheck(name, len(t_ns), n_expected, rate_hz, longest_ms, level))
    return checks


def stream_findings(streams: Sequence[StreamCheck]) -> list[Finding]:
    """Return what streams lack; streams that lack the same (one busy computer) share a finding."""
    findings = []
    alike: dict[tuple[Level, str], list[str]] = {}
    for stream in streams:
        if stream.expected is None:
            continue
        if stream.rows == 0:
            message, redo = "delivered nothing", "check the device, then redo the session"
            findings.append(Finding(Level.RED, stream.stream, message, redo))
        elif stream.level is not Level.GREEN:
            share = 100 * stream.rows / stream.expected
            message = (
                f"{share:.0f} % of the expected samples, longest gap {stream.longest_gap_ms:.0f} ms"
            )
            alike.setdefault((stream.level, message), []).append(stream.stream)
    for (level, message), (first, *others) in alike.items():
        also = f"; so {', '.join(others)}" if others else ""
        findings.append(Finding(level, first, message + also))
    if not streams:
        findings.append(Finding(Level.RED, "streams", "nothing was recorded", "redo the session"))
    return findings


def _pace_findings(recording: Recording) -> list[Finding]:
    """Tell, part by part, where the display's runtime halved its rate or showed frames again."""
    names = recording.stream_names
    schema = recording.stream_schema("frames") if "frames" in names else None
    if schema is None or not schema.nominal_rate_hz:
        return []
    nominal_ns = round(NS_PER_S / schema.nominal_rate_hz)
    findings = []
    for part in recording.manifest.parts:
        begun_ns = recording.stream_arrays("frames", part=part.number)["t_host_ns"]
        account = None
        if "frame_timing" in names:
            account = recording.stream_arrays("frame_timing", part=part.number)
        sentences = runtime_pace(begun_ns, nominal_ns, account).sentences
        findings += [Finding(Level.AMBER, "pace", sentence) for sentence in sentences]
    return findings


def _is_on_page(recording: Recording) -> bool:
    """Tell whether a session was performed on a page, which sends samples only from a headset."""
    configuration = recording.manifest.configuration
    return isinstance(configuration, Mapping) and configuration.get("on") == "browser"


def _luminance_findings(recording: Recording, events: Events) -> list[Finding]:
    """Tell of greys and contrasts on a screen whether they are of light."""
    configuration = recording.manifest.configuration
    entry = configuration.get(LUMINANCE_KEY) if isinstance(configuration, Mapping) else None
    items = [str(payload.get("option_items", "")) for name, payload in events if name == "shown"]
    if entry is None or not any(kind in text for text in items for kind in OF_GREYS):
        return []
    table = table_of_entry(entry)
    text = NO_LUMINANCES if table is None else f"greys and contrasts are of light: {table.summary}"
    return [Finding(Level.GREEN, "luminance", text)]


def _window_findings(recording: Recording) -> list[Finding]:
    """Tell how late windows that follow gaze came; nothing of a session without."""
    if GAZE_WINDOW not in recording.stream_names:
        return []
    delay_ms = recording.stream_arrays(GAZE_WINDOW)["delay_ms"]
    delay_ms = delay_ms[np.isfinite(delay_ms)]
    if not len(delay_ms):
        return [Finding(Level.RED, "gaze window", "never followed gaze", "look at the tracker")]
    median, p95 = np.percentile(delay_ms, (50, 95))
    text = f"{median:.0f} ms behind gaze in the median, {p95:.0f} ms at the 95th percentile"
    if p95 <= UNNOTICED_MS:
        return [Finding(Level.GREEN, "gaze window", text)]
    late = f"{text}; more than {UNNOTICED_MS:g} ms is noticed (Loschky & Wolverton 2007)"
    return [Finding(Level.AMBER, "gaze window", late, "use a faster tracker or display")]


# ---- calibration -----------------------------------------------------------------------------


def _calibration_findings(
    plan: Mapping[str, Any], events: Events, limits: CheckLimits
) -> list[Finding]:
    validations = _payloads(events, "validation")
    blocks = plan.get("blocks", [])
    if not validations and blocks and not any(b.get("calibrate", True) for b in blocks):
        return []  # a study without gaze
    if not validations:
        return [
            Finding(
                Level.RED, "calibration", "no validation was recorded", "calibrate and validate"
            )
        ]
    findings = []
    in_force = {v["block"]: v for v in validations if v["moment"] == "block_start"}
    for block, v in in_force.items():
        if not v["accepted"]:
            findings.append(
                Finding(Level.AMBER, "calibration", f"block {block} not accepted: {v['reason']}")
            )
    ends = [v for v in validations if v["moment"] == "end"]
    if not ends:
        findings.append(
            Finding(
                Level.AMBER,
                "calibration",
                "no validation at the end, so drift over the last block is unknown",
            )
        )
    else:
        findings.append(_drift_finding(list(in_force.values()), ends[-1], limits))
    return findings


def _drift_finding(
    starts: list[Mapping[str, Any]], end: Mapping[str, Any], limits: CheckLimits
) -> Finding:
    end_deg = end["accuracy_deg"]
    if end_deg is None and end["accepted"] and not end.get("points"):
        return Finding(Level.GREEN, "calibration", str(end["reason"]))
    if end_deg is None:
        return Finding(
            Level.RED, "calibration", "all gaze was lost in the final validation", REDO_BLOCK
        )
    start_deg = starts[-1]["accuracy_deg"] if starts else None
    drift_deg = 0.0 if start_deg is None else end_deg - start_deg
    level = Level.GREEN
    if end_deg > limits.accuracy_amber_deg or drift_deg > limits.drift_amber_deg:
        level = Level.AMBER
    if end_deg > limits.accuracy_red_deg or drift_deg > limits.drift_red_deg:
        level = Level.RED
    message = f"accuracy {end_deg:.2f}° at the end{drift_words(start_deg, end_deg)}"
    return Finding(level, "calibration", message, REDO_BLOCK if level is Level.RED else "")


def drift_words(start_deg: float | None, end_deg: float) -> str:
    """Return how accuracy changed since the last block began; empty where that is unknown.

    Gaze that got worse has drifted; one that got better was measured at a better moment.
    """
    if start_deg is None:
        return ""
    change = f"{abs(end_deg - start_deg):.2f}"
    if change == "0.00":
        return ", as before the last block"
    return f", {change}° {'worse' if end_deg > start_deg else 'better'} than before the last block"


# ---- questionnaires and deviations -----------------------------------------------------------


def _questionnaire_findings(plan: Mapping[str, Any], events: Events) -> list[Finding]:
    complete = {p["questionnaire"] for p in _payloads(events, "questionnaire_complete")}
    blocks = plan.get("blocks", ())
    if not plan.get("questionnaires") and not any(b.get("questionnaires") for b in blocks):
        return []  # nobody is asked anything
    findings = [
        Finding(
            Level.RED,
            "questionnaires",
            f"{name} is missing",
            "continue with `visavis resume`; it asks what is missing",
        )
        for name in (
            *(
                f"{n}@{b['index']}"
                for b in plan.get("blocks", ())
                for n in b.get("questionnaires", ())
            ),
            *plan.get("questionnaires", ()),
        )
        if name not in complete
    ]
    left_out: dict[str, int] = {}
    for p in _payloads(events, "answer"):
        if p["answer"] is None:
            left_out[p["questionnaire"]] = left_out.get(p["questionnaire"], 0) + 1
    for name, count in left_out.items():
        level = Level.GREEN if name == "free_comment" else Level.AMBER
        findings.append(Finding(level, "questionnaires", f"{name}: {count} left out"))
    if not findings:
        findings.append(Finding(Level.GREEN, "questionnaires", "all answered"))
    return findings


def _practice_findings(events: Events, rows: Rows, recording: Recording) -> list[Finding]:
    """Tell in how many rounds was practised, and whether the last one sufficed."""
    rounds = 1 + len(_payloads(events, "practice_again"))
    count = f"practised in {rounds} round{'s' if rounds > 1 else ''}"
    configuration = recording.manifest.configuration
    design = configuration.get(DESIGN_KEY) if isinstance(configuration, Mapping) else None
    criterion = design.get(PRACTICE_UNTIL_KEY) if isinstance(design, Mapping) else None
    if not criterion:  # none, or a session that did not keep it
        message = f"{count}; whether the study's criterion was met was not kept"
        return [Finding(Level.GREEN, "trials", message)] if rounds > 1 else []
    done = [r for r in rows if r["is_practice"] and r["status"] == "complete"]
    last = done[-_practice_trials(recording.manifest.plan) :]
    if not last:
        return []
    right = sum(row.get(criterion["of"]) in (True, 1) for row in last)
    is_met = right >= criterion["min_01"] * len(last) - 1e-9
    message = (
        f"{count}; the study's criterion was {'met' if is_met else 'not met'}: {criterion['of']} "
        f"held in {right} of the last {len(last)} trials, {criterion['min_01']:.0%} are asked for"
    )
    return [Finding(Level.GREEN if is_met else Level.AMBER, "trials", message)]


def _deviation_findings(events: Events, rows: Rows, recording: Recording) -> list[Finding]:
    findings = [
        Finding(
            Level.AMBER,
            "interruption",
            f"part {part.number} {'crashed' if part.status == 'crashed' else 'ended early'}"
            + _because(part.reason),
        )
        for part in recording.manifest.parts[:-1]
    ]
    for row in (r for r in rows if r.get("status") == "interrupted"):
        message = f"{row['trial_id']}, attempt {row['attempt']}, was interrupted"
        findings.append(Finding(Level.AMBER, "trials", message + _because(row["reason"])))
    again = [f"{r['trial_id']} ({r['reason']})" for r in rows if r.get("status") == "repeated"]
    if again:
        message = f"repeated by the study's own rule: {_name_list(again)}"
        findings.append(Finding(Level.GREEN, "trials", message))
    findings += _practice_findings(events, rows, recording)
    findings += [
        Finding(
            Level.AMBER, "trials", f"the {p['of']} ended early after {p['trial_id']}: {p['reason']}"
        )
        for p in _payloads(events, "ended_early")
    ]
    repeats = [p["trial_id"] for p in _payloads(events, "trial_repeat")]
    if repeats:
        message = f"repeated on the operator's request: {_name_list(repeats)}"
        findings.append(Finding(Level.AMBER, "trials", message))
    # A fault that repeats with other numbers is one finding with the range of its numbers.
    faults: dict[tuple[str, str], list[str]] = {}
    for p in _payloads(_once_calibrated(events), "fault"):
        message = str(p["message"])
        faults.setdefault((str(p["role"]), _NUMBER.sub("#", message)), []).append(message)
    findings += [
        Finding(
            Level.AMBER,
            role,
            in_one(messages) + (f" ({len(messages)} times)" if len(messages) > 1 else ""),
        )
        for (role, _), messages in faults.items()
    ]
    findings += [
        Finding(Level.AMBER, str(p["role"]), f"was away for {p['away_s']:.1f} s, then came back")
        for p in _payloads(events, "device_back")
    ]
    findings += [
        Finding(Level.AMBER, role, "the operator went on without it; trials are flagged")
        for role in dict.fromkeys(str(p["role"]) for p in _payloads(events, "device_done_without"))
    ]
    # Of calibrations that failed the last message is the one to act on.
    failures = [p["message"] for p in _payloads(events, "calibration") if not p["succeeded"]]
    if failures:
        findings.append(
            Finding(
                Level.AMBER,
                "calibration",
                f"calibrations that failed: {len(failures)}; {failures[-1]}",
            )
        )
    for name, text in (
        ("pause_start", "pauses"),
        ("calibration_below_threshold", "blocks run on a calibration below the threshold"),
    ):
        count = len(_payloads(events, name))
        if count:
            level = Level.GREEN if name == "pause_start" else Level.AMBER
            findings.append(Finding(level, "deviation", f"{text}: {count}"))
    requests = _payloads(events, "operator")
    reason_counts = Counter(str(p["code"]) for p in requests if p.get("code"))
    if reason_counts:
        reasons = "; ".join(
            f"{reason_words(code, recording)} {'once' if count == 1 else f'{count} times'}"
            for code, count in sorted(reason_counts.items())
        )
        findings.append(Finding(Level.AMBER, "reasons", f"given by the operator: {reasons}"))
    flags = sum(p["action"] == "flag" for p in requests)
    if flags:
        findings.append(Finding(Level.AMBER, "flag", f"moments flagged by the operator: {flags}"))
    notes = [p["text"] for p in requests if p["action"] in ("note", "reason")]
    findings += [Finding(Level.AMBER, "note", str(text)) for text in notes if text]
    return findings


def in_one(messages: Sequence[str]) -> str:
    """Return messages that differ in their numbers as one, with the range of each number."""
    words = _NUMBER.split(messages[0])
    columns = zip(*(_NUMBER.findall(message) for message in messages), strict=True)
    ranges = []
    for column in columns:
        low, high = min(column, key=float), max(column, key=float)
        ranges.append(low if float(low) == float(high) else f"{low} to {high}")
    return "".join(w + r for w, r in zip(words, [*ranges, ""], strict=True))


def _payloads(events: Events, name: str) -> list[Mapping[str, Any]]:
    return [payload for event, payload in events if event == name]


def _because(reason: object) -> str:
    return f": {reason}" if reason else ""


def _once_calibrated(events: Events) -> Events:
    """Leave out events before the first calibration: a tracker that asks for one is no fault."""
    first = next((i for i, (name, _) in enumerate(events) if name == "calibration"), 0)
    return events[first:]

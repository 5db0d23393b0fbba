"""What the command line adds to a session: LSL streams, LabRecorder, the doctor's report."""

from collections.abc import Callable, Mapping
from pathlib import Path

from visavis.cli.doctor.findings import Finding
from visavis.cli.doctor.report import save_with_session
from visavis.cli.lab_recorder import LabRecorder
from visavis.cli.lsl_announcer import AnnouncingRecorder, scope_of, set_scope
from visavis.devices.contracts import Device
from visavis.recording.writer import Recorder
from visavis.running.sessions.session_request import Request


class LabCompanion:
    """The command line's `sessions.perform.Companion`; `warn` gets messages on a bad ending.

    `station` are the findings on the computer's timing before the session; they are saved with
    the doctor's report.
    """

    def __init__(
        self, warn: Callable[[str], None] = lambda _: None, station: tuple[Finding, ...] = ()
    ) -> None:
        self._warn = warn
        self._station = station
        self._lab_recorder: LabRecorder | None = None

    def recorder(self, request: Request, part_dir: Path, *, is_simulated: bool) -> Recorder | None:
        """Return a recorder that streams to LSL, too; None where the lab does not use LSL."""
        if not request.config.sync.lsl:
            return None
        set_scope(scope_of(request.config.sync))
        return AnnouncingRecorder(part_dir, request.clock, is_simulated=is_simulated)

    def on_open(
        self,
        request: Request,
        part_dir: Path,
        devices: Mapping[str, Device],
        recorder: Recorder,
        *,
        is_simulated: bool,
    ) -> None:
        """Announce the open devices' streams, start LabRecorder, and save the doctor's report."""
        if request.config.sync.lsl:
            assert isinstance(recorder, AnnouncingRecorder)  # noqa: S101 - `recorder` made it
            recorder.announce(
                devices,
                scope_of(request.config.sync),
                source=f"{request.study.name}-{request.person.label}-{request.person.session:03d}",
                is_simulated=is_simulated,
            )
        if request.config.sync.lab_recorder:
            self._lab_recorder = LabRecorder(request.config.sync.lab_recorder)
            part = int(part_dir.name.rpartition("-")[2])
            self._lab_recorder.start(
                study=request.study.name,
                participant=request.person.label,
                session=request.person.session,
                part=part,
            )
            recorder.event("lab_recorder_start", request.clock.now_ns(), part=part)
        save_with_session(part_dir, request.config, request.clock, devices, self._station)

    def on_close(self) -> None:
        """End LabRecorder's file after ours, so that it contains our last samples."""
        if self._lab_recorder is not None and (trouble := self._lab_recorder.stop()):
            self._warn(trouble)
        self._lab_recorder = None

"""What the command line lets go along with a session: LSL streams, and the doctor's note."""

from collections.abc import Mapping
from pathlib import Path

from cli.doctor.report import save_with_session
from devices.contracts import Device
from recording.writer import Recorder
from visavis.sessions.perform import Request


class LabCompanion:
    """Follow `visavis.sessions.perform.Companion`."""

    def recorder(self, request: Request, part_dir: Path, *, is_simulated: bool) -> Recorder | None:
        """Return one that streams to LSL too, where the lab wants that."""
        if not request.config.sync.lsl:
            return None
        from cli.lsl_announcer import AnnouncingRecorder, scope_of, set_scope

        set_scope(scope_of(request.config.sync))
        return AnnouncingRecorder(part_dir, request.clock, is_simulated=is_simulated)

    def opened(
        self,
        request: Request,
        part_dir: Path,
        devices: Mapping[str, Device],
        recorder: Recorder,
        *,
        is_simulated: bool,
    ) -> None:
        """Announce the open devices' streams, and keep what the doctor says of them."""
        if request.config.sync.lsl:
            from cli.lsl_announcer import AnnouncingRecorder, scope_of

            assert isinstance(recorder, AnnouncingRecorder)  # noqa: S101 - made above, for this
            recorder.announce(
                devices,
                scope_of(request.config.sync),
                source=f"{request.study.name}-{request.participant_label}-{request.session:03d}",
                is_simulated=is_simulated,
            )
        save_with_session(part_dir, request.config, request.clock, devices)

"""Send what a session records to Lab Streaming Layer (LSL), too, if the lab's `sync` says so."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from visavis.devices.contracts import ClockPair, Device
from visavis.devices.drivers.lsl.outlet import LslOutlets, LslScope
from visavis.lab.clock import Clock
from visavis.lab.clock_fit import latest_quick, offset_ns
from visavis.lab.config import Sync
from visavis.lab.errors import DeviceNotFound
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.recording.summary import PartSummary
from visavis.recording.writer import REAL_TIME_BATCH_NS, CloseStatus, Recorder

OWN_NAMES = ("name", "t_ns")


class AnnouncingRecorder(Recorder):
    """A recorder that also sends its devices' streams, events and trials through LSL.

    LSL gets a sample after it is recorded, and cannot delay the recording: the outlets hold no
    queue of ours. Call `announce` once the devices are open.
    """

    def __init__(self, part_dir: Path, clock: Clock, *, is_simulated: bool) -> None:
        super().__init__(
            part_dir,
            clock,
            threaded=True,
            max_batch_ns=REAL_TIME_BATCH_NS,
            is_simulated=is_simulated,
        )
        self._session_clock = clock
        self._outlets: LslOutlets | None = None
        self._role_of: dict[str, str] = {}
        self._declared_schemas: dict[str, StreamSchema] = {}

    def announce(
        self,
        devices: Mapping[str, Device],
        scope: LslScope,
        *,
        source: str,
        is_simulated: bool,
        lsl: Any = None,
    ) -> None:
        """Announce the devices' declared streams; `lsl` replaces the library in tests.

        Raises:
            DeviceNotFound: LSL's library is not installed.
        """
        streams = {
            role: [s for s in self._declared_schemas.values() if _is_of(role, device, s)]
            for role, device in devices.items()
        }
        self._role_of = {
            s.name: role for role, role_streams in streams.items() for s in role_streams
        }
        self._outlets = LslOutlets(
            streams,
            scope,
            self._session_clock,
            source=source,
            is_simulated=is_simulated,
            offset_of=_Offsets(devices).of,
            lsl=lsl,
        )

    def declare(self, schema: StreamSchema) -> None:
        """Create the file of a stream, and keep its schema for the announcement."""
        super().declare(schema)
        self._declared_schemas[schema.name] = schema

    def append(self, batch: SampleBatch) -> None:
        """Record a batch, then send it."""
        super().append(batch)
        role = self._role_of.get(batch.schema.name)
        if role is not None and self._outlets is not None:
            self._outlets.take(role, batch)

    def event(self, name: str, t_ns: int, /, **payload: Any) -> None:
        """Record an event, then send it; a detail named like an LSL field gets an underscore."""
        super().event(name, t_ns, **payload)
        if self._outlets is not None:
            self._outlets.event(name, int(t_ns), **_lsl_payload(payload))

    def trial(self, row: Mapping[str, Any]) -> None:
        """Record a trial's row, then send it as an event."""
        super().trial(row)
        if self._outlets is not None:
            self._outlets.event("trial", self._session_clock.now_ns(), **_lsl_payload(row))

    def close(self, status: CloseStatus) -> PartSummary:
        """Withdraw the streams and end every file."""
        if self._outlets is not None:
            self._outlets.close()
            self._outlets = None
        return super().close(status)


class _Offsets:
    """Host-minus-device clock offsets by role, fitted again after each new exchange of times."""

    def __init__(self, devices: Mapping[str, Device]) -> None:
        self._devices = devices
        self._cached_offsets: dict[str, tuple[ClockPair, int]] = {}

    def of(self, role: str) -> int | None:
        pairs = self._devices[role].clock_pairs()
        if not pairs:
            return None
        if role not in self._cached_offsets or self._cached_offsets[role][0] != pairs[-1]:
            self._cached_offsets[role] = (pairs[-1], offset_ns(latest_quick(pairs)))
        return self._cached_offsets[role][1]


def scope_of(sync: Sync) -> LslScope:
    """Return the LSL session to use: the default one, which LabRecorder sees, or the lab's own."""
    return LslScope(sync.session_id, machine_only=sync.this_computer_only)


def set_scope(scope: LslScope) -> None:
    """Set the scope of LSL's library; it reads it once, before the first device uses it.

    Raises:
        DeviceNotFound: the library is not installed.
    """
    try:
        import pylsl
    except (ImportError, RuntimeError) as cause:  # RuntimeError: liblsl itself is missing
        raise DeviceNotFound(
            "sync.lsl is on, but the library pylsl cannot be loaded",
            remedy="run: pip install 'visavis[lsl]', or set sync.lsl to false",
        ) from cause
    if configuration := scope.configuration():
        pylsl.set_config_content(configuration)


def _is_of(role: str, device: Device, schema: StreamSchema) -> bool:
    return any(schema.name in (own.name, f"{own.name}_{role}") for own in device.describe())


def _lsl_payload(payload: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{k}_" if k in OWN_NAMES else k: v for k, v in payload.items()}

"""Stream gaze, poses and events to Lab Streaming Layer while a session runs.

Channels have the XDF meta-data names, so other labs' tools can read them. Stamps are on LSL's
clock: a sample's own time where its device's offset is known, its arrival otherwise.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from visavis.devices.contracts import HEAD, HEAD_MEASURED
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import DeviceNotFound
from visavis.lab.schema import SampleBatch, StreamSchema
from visavis.lab.xdf_channels import channels_of, content_type, describe, flat_values

CLOCK_READINGS = 20
DATED_HEADS = (HEAD.name, HEAD_MEASURED.name)
"""Streams whose `t_device_ns` is the session time that a pose describes, also one to come."""
UNSAFE = set("\r\n;#[]=,{}")

OffsetOf = Callable[[str], int | None]


@dataclass(frozen=True)
class LslScope:
    """The reach of streams: `session` separates groups, `machine_only` keeps to this computer.

    With neither, LSL's own settings hold (its file `lsl_api.cfg`), as for every other program.
    """

    session: str = ""
    machine_only: bool = False

    def configuration(self) -> str:
        """Return the library's configuration text; empty to leave its own in force."""
        if not self.session and not self.machine_only:
            return ""
        session_id = "".join(c for c in self.session if c not in UNSAFE) or "default"
        lines = ["[lab]", f"SessionID = {session_id}"]
        if self.machine_only:
            lines = ["[multicast]", "ResolveScope = machine", *lines, "KnownPeers = {127.0.0.1}"]
        return "\n".join(lines) + "\n"


class LslOutlets:
    """One outlet per stream and one for events; open before the session, close after it.

    `offset_of` gives a role's host-minus-device offset (ns), or None. The scope must be set
    before anything else in the process uses LSL; `lsl` is the library, given in tests.
    """

    def __init__(
        self,
        streams: Mapping[str, Sequence[StreamSchema]],
        scope: LslScope,
        clock: Clock,
        *,
        source: str,
        is_simulated: bool,
        offset_of: OffsetOf | None = None,
        lsl: Any = None,
    ) -> None:
        self._clock = clock
        self._offset_of = offset_of
        self._lsl = lsl if lsl is not None else lsl_library()
        if configuration := scope.configuration():
            self._lsl.set_config_content(configuration)
        self.clock_difference_ns = self._measure_difference()
        self._outlets: dict[tuple[str, str], Any] = {}
        self.pushed_count = 0
        for role, schemas in streams.items():
            for schema in schemas:
                info = self._lsl.StreamInfo(
                    f"visavis {role} {schema.name}",
                    content_type(schema),
                    len(channels_of(schema)),
                    schema.nominal_rate_hz,
                    self._lsl.cf_double64,
                    f"{source}-{role}-{schema.name}",
                )
                self._note(info, schema, is_simulated=is_simulated)
                self._outlets[role, schema.name] = self._lsl.StreamOutlet(info, 1)
        events = self._lsl.StreamInfo(
            "visavis events", "Markers", 1, 0.0, self._lsl.cf_string, f"{source}-events"
        )
        self._note(events, None, is_simulated=is_simulated)
        self._events: Any = self._lsl.StreamOutlet(events, 1)

    def take(self, role: str, batch: SampleBatch) -> None:
        """Push a batch; streams that were not announced are ignored."""
        outlet = self._outlets.get((role, batch.schema.name))
        if outlet is None or not len(batch):
            return
        stamps_ns = batch.t_host_ns
        offset = self._offset_of(role) if self._offset_of is not None else None
        if batch.schema.name in DATED_HEADS:
            stamps_ns = batch.t_device_ns
        elif offset is not None:
            stamps_ns = np.minimum(batch.t_device_ns + offset, batch.t_host_ns)
        stamps_s = (stamps_ns + self.clock_difference_ns) / NS_PER_S
        for row, stamp_s in zip(flat_values(batch).tolist(), stamps_s.tolist(), strict=True):
            outlet.push_sample(row, stamp_s)
        self.pushed_count += len(batch)

    def event(self, name: str, t_ns: int, **payload: Any) -> None:
        """Push an event as JSON text, stamped with its session time."""
        text = json.dumps({"event": name, **payload}, ensure_ascii=False, default=str)
        self._events.push_sample([text], (t_ns + self.clock_difference_ns) / NS_PER_S)

    def close(self) -> None:
        """Withdraw the streams; idempotent."""
        self._outlets = {}
        self._events = _Nowhere()

    def _measure_difference(self) -> int:
        """Return LSL's clock minus the session's, from the closest of some readings."""
        best = (2**62, 0)
        for _ in range(CLOCK_READINGS):
            before_ns = self._clock.now_ns()
            lsl_ns = round(self._lsl.local_clock() * NS_PER_S)
            after_ns = self._clock.now_ns()
            best = min(best, (after_ns - before_ns, lsl_ns - (before_ns + after_ns) // 2))
        return best[1]

    def _note(self, info: Any, schema: StreamSchema | None, *, is_simulated: bool) -> None:
        desc = info.desc()
        desc.append_child_value("is_simulated", "true" if is_simulated else "false")
        if schema is not None:
            description = Element("desc")
            describe(description, schema)
            _copy(description, desc)


class _Nowhere:
    """Where events go after closing."""

    def push_sample(self, row: object, stamp_s: float) -> None:
        """Drop it."""


def _copy(source: Element, target: Any) -> None:
    for child in source:
        if len(child):
            _copy(child, target.append_child(child.tag))
        else:
            target.append_child_value(child.tag, child.text or "")


def lsl_library() -> Any:
    """Return pylsl; raises DeviceNotFound where it cannot be loaded."""
    try:
        import pylsl
    except (ImportError, RuntimeError) as cause:  # RuntimeError: liblsl itself is missing
        raise DeviceNotFound(
            "the library pylsl cannot be loaded", remedy="run: pip install pylsl"
        ) from cause
    return pylsl

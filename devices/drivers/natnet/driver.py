"""Receive a moving body from OptiTrack Motive over NatNet (UDP 1510 and 1511).

Codec: `visavis.devices.drivers.natnet.codec`. Device time is the middle of the cameras' exposure on
Motive's clock, which cannot be asked, so `health` fits it by the lower envelope of the arrivals.
Motive must stream with y up. A T-pose faces +z there and −z here, so its world is turned about y by
180°, or by `yaw_deg`.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from visavis.devices.drivers.natnet import codec
from visavis.devices.drivers.natnet.spec import MOTIVE_BONES, NATNET
from visavis.devices.drivers.streaming.body_device import (
    BodyDevice,
    BodySample,
    turn_world,
    upright,
)
from visavis.devices.one_of_a_kind import the_only
from visavis.devices.plausible import TICKS_PER_S
from visavis.devices.transports import Message, MessageTransport
from visavis.lab.clock import NS_PER_S, Clock
from visavis.lab.errors import ConfigError, DataError, DeviceTimeout, ProtocolViolation

COMMAND_PORT, DATA_PORT, GROUP = 1510, 1511, "239.255.42.99"
KEEP_ALIVE_EVERY_NS = NS_PER_S
ASK_AGAIN_NS = NS_PER_S // 4


class NatNet(BodyDevice):
    """Follow the `BodyTracker` contract over Motive's stream.

    `bodies` maps names of rigid bodies in Motive to segments; without it the bones of `skeleton`
    (or of the only one) are taken by `MOTIVE_BONES`. `check` reports a name that Motive does not
    know, and its segment is not valid.
    """

    def __init__(
        self,
        role: str,
        transport: MessageTransport,
        clock: Clock,
        *,
        bodies: Mapping[str, str] | None = None,
        skeleton: str = "",
        rate_hz: float = 120.0,
        yaw_deg: float = 180.0,
        lost_after_s: float = 2.0,
    ) -> None:
        self._names = dict(bodies) if bodies else dict(MOTIVE_BONES)
        if len(set(self._names.values())) != len(self._names):
            raise ConfigError(f"{role}: two bodies are mapped to one segment; give each its own")
        self._by_bones = not bodies
        self._skeleton = skeleton
        self._world = upright("+Y", yaw_deg)
        self._server: codec.Server | None = None
        self._models: codec.Models | None = None
        self._row_of: dict[int | tuple[int, int], int] = {}
        self._sent_ns = 0
        super().__init__(
            role,
            transport,
            clock,
            NATNET,
            segments=tuple(self._names.values()),
            rate_hz=rate_hz,
            lost_after_s=lost_after_s,
        )

    def _connect(self, deadline_ns: int) -> None:
        self._server, self._models = None, None
        self._ask_until(deadline_ns, codec.CONNECT, b"Ping\0", lambda: self._server is not None)
        server = self._require_server()
        if not codec.OLDEST <= server.version:
            raise ProtocolViolation(
                f"{server.program} speaks NatNet {server.version[0]}.{server.version[1]}; this "
                "driver needs 3.0 or newer",
                remedy="install a current Motive",
            )
        if not TICKS_PER_S.admit(server.clock_hz):
            raise ProtocolViolation(
                TICKS_PER_S.sentence(f"the clock of {server.program}", server.clock_hz),
                remedy="report the .wire log with the version of Motive",
            )
        if server.version > codec.NEWEST_KNOWN:
            text = f"NatNet {server.version[0]}.{server.version[1]} is newer than this driver"
            remedy = "compare a short capture with Motive before you rely on it"
            self._note("version", self._warning(text, remedy))
        self.info = replace(self.info, model=f"{server.program} {server.program_version}".strip())
        self._ask_until(deadline_ns, codec.REQUEST_MODEL, b"", lambda: self._models is not None)
        self._require_one_skeleton()

    def _require_one_skeleton(self) -> None:
        if self._models is None or self._skeleton or not self._by_bones:
            return
        skeletons = sorted({skeleton for skeleton, _ in self._models.bones})
        if len(skeletons) > 1:
            remedy = "give skeleton in lab_config.yaml, or stream only one"
            the_only(skeletons, repr, "skeletons in Motive", remedy)

    def _require_server(self) -> codec.Server:
        if self._server is None:
            raise DeviceTimeout("Motive did not say who it is", remedy=NATNET.remedy)
        return self._server

    def _ask_until(
        self, deadline_ns: int, message: int, payload: bytes, is_there: Callable[[], bool]
    ) -> None:
        while not is_there():
            now_ns = self._clock.now_ns()
            if now_ns >= deadline_ns:
                raise DeviceTimeout("Motive did not answer in time", remedy=NATNET.remedy)
            self._transport.post((codec.encode(message, payload),))
            until_ns = min(now_ns + ASK_AGAIN_NS, deadline_ns)
            while not is_there() and (left_ns := until_ns - self._clock.now_ns()) > 0:
                for reply in self._transport.receive(left_ns / NS_PER_S):
                    tuple(self._decode(reply))

    def _resume(self) -> None:
        self._transport.post((codec.encode(codec.CONNECT, b"Ping\0"),))
        self._transport.post((codec.encode(codec.REQUEST_MODEL),))

    def _tick(self, now_ns: int) -> None:
        if now_ns - self._sent_ns >= KEEP_ALIVE_EVERY_NS:
            self._sent_ns = now_ns
            self._transport.post((codec.encode(codec.KEEP_ALIVE),))

    def _decode(self, message: Message) -> Iterable[BodySample]:
        try:
            kind, payload = codec.split_message(message.frames[0])
            if kind == codec.SERVER_INFO:
                self._server = codec.decode_server(payload)
            elif self._server is None or self._server.version < codec.OLDEST:
                return ()
            elif kind == codec.MODEL:
                self._models = codec.decode_models(payload, self._server.version)
                self._map_names(self._models)
            elif kind == codec.FRAME and self._models is not None:
                return (self._sample(codec.decode_frame(payload, self._server.version)),)
        except DataError:
            self._malformed += 1
        return ()

    def _map_names(self, models: codec.Models) -> None:
        rows = {segment: row for row, segment in enumerate(self.segments)}
        self._row_of = {}
        mapped_names: set[str] = set()
        if self._by_bones:
            skeletons = sorted({skeleton for skeleton, _ in models.bones})
            skeleton_name = self._skeleton or (skeletons[0] if skeletons else "")
            for (skeleton, bone), at in models.bones.items():
                if skeleton == skeleton_name and bone in self._names:
                    self._row_of[at] = rows[self._names[bone]]
                    mapped_names.add(bone)
        else:
            for name, number in models.bodies.items():
                if name in self._names:
                    self._row_of[number] = rows[self._names[name]]
                    mapped_names.add(name)
        missing = [name for name in self._names if name not in mapped_names]
        text = f"Motive does not know {', '.join(missing)}"
        fault = self._warning(text, "create it in Motive, or name the bodies as they are there")
        self._note("names", fault if missing else None)

    def _sample(self, frame: codec.Frame) -> BodySample:
        if frame.models_changed:
            self._transport.post((codec.encode(codec.REQUEST_MODEL),))
        n = len(self.segments)
        position = np.full((n, 3), np.nan)
        turn = np.full((n, 4), np.nan)
        valid = np.zeros(n, np.bool_)
        bodies: Mapping[int, codec.RigidBody] | Mapping[tuple[int, int], codec.RigidBody]
        bodies = frame.bones if self._by_bones else frame.bodies
        for key, body in bodies.items():
            row = self._row_of.get(key)
            if row is None or not body.is_tracked:
                continue
            i, j, k, w = body.turn_xyzw
            length = w * w + i * i + j * j + k * k
            if abs(length - 1) < 0.02:
                position[row] = body.position
                turn[row] = np.array((w, i, j, k)) / np.sqrt(length)
                valid[row] = True
        turn_world(self._world, position, turn, valid)
        clock_hz = self._server.clock_hz if self._server is not None else 0
        device_ns = frame.exposure_ticks * NS_PER_S // clock_hz if clock_hz else 0
        return BodySample(frame.number, device_ns, position, turn, valid)

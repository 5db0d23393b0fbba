"""Gazepoint's Open Gaze server as seen from its TCP port, in memory.

Written from the vendor's document (see `drivers.gazepoint.codec`). Not modelled: the camera
picture, the fixation filter, custom calibration points, the server's own recording. The stream is
cut and joined at places drawn from the seed; a stream cannot lose or reorder bytes, so those faults
apply to whole records.
"""

import struct
from collections import deque
from collections.abc import Callable
from typing import Unpack

import numpy as np

from visavis.devices.contracts import Body
from visavis.devices.drivers.streaming.screen import Screen, Triple
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames, Message
from visavis.lab.clock import NS_PER_S

TICKS_PER_S = 10_000_000
NEWEST_API = "2.4"
SPLIT_SHARE = 0.3
CALIBRATION_POINTS = ((0.5, 0.5), (0.85, 0.15), (0.85, 0.85), (0.15, 0.85), (0.15, 0.15))
POINT_NS = NS_PER_S // 2
MAX_ANNOTATIONS = 1_000

_SPLIT_STREAM = 0x59


class GazepointSimulator(GazePeer):
    """Answer commands and stream records of a body that looks at a screen.

    The eyes are at the viewing place, or by `moved_m` away from it at a session time;
    `camera_m` is the camera's place in the frame of the viewing place.
    """

    driver = "gazepoint"
    usual_rate_hz = 60.0

    def __init__(
        self,
        body: Body,
        *,
        screen: Screen | None = None,
        camera_m: Triple = (0.0, -0.18, -0.65),
        split_share: float = SPLIT_SHARE,
        moved_m: Callable[[int], Triple] = lambda t_ns: (0.0, 0.0, 0.0),
        ticks_per_s: int = TICKS_PER_S,
        trackers: int = 1,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.annotations: deque[str] = deque(maxlen=MAX_ANNOTATIONS)
        self.ticks_per_s = ticks_per_s
        self.trackers = trackers
        self._screen = screen or Screen()
        self._camera = camera_m
        self._split_share = split_share
        self._moved_m = moved_m
        self._splits = np.random.default_rng([measuring["seed"], _SPLIT_STREAM])
        self._enabled: set[str] = set()
        self._user = ""
        self._calibration_ns: int | None = None
        self._open: list[tuple[bool, bool]] = []

    @property
    def is_busy(self) -> bool:
        """Tell whether it calibrates."""
        return self._calibration_ns is not None

    def advance(self, t_ns: int) -> None:
        """Take samples; a server that was gone starts with everything off."""
        if self.source.is_away(t_ns):
            self._enabled.clear()
        super().advance(t_ns)
        if self._calibration_ns is not None:
            end_ns = self._calibration_ns + POINT_NS * len(CALIBRATION_POINTS)
            if t_ns >= end_ns:
                self._finish_calibration(end_ns)

    def to_message(self, shot: Shot) -> Frames | None:
        """Return one record, with the fields that were enabled."""
        if self._calibration_ns is not None:
            self._open.append((shot.left_seen, shot.right_seen))
        if "DATA" not in self._enabled:
            return None
        if shot.garbage is not None:
            return (shot.garbage.replace(b"\n", b"?") + b"\r\n",)
        return (self._record(shot).encode(),)

    def outgoing(self, until_ns: int) -> list[Message]:
        """Return the chunks that have arrived: lines of one time joined, some chunks cut in two."""
        packets: list[tuple[int, bytes]] = []
        for message in super().outgoing(until_ns):
            if packets and packets[-1][0] == message.t_host_ns:
                packets[-1] = (message.t_host_ns, packets[-1][1] + message.frames[0])
            else:
                packets.append((message.t_host_ns, message.frames[0]))
        chunks: list[Message] = []
        for at_ns, data in packets:
            cut = 0
            if len(data) > 2 and self._splits.random() < self._split_share:
                cut = int(self._splits.integers(1, len(data) - 1))
                chunks.append(Message(at_ns, (data[:cut],)))
            chunks.append(Message(at_ns, (data[cut:],)))
        return chunks

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Take commands; answers go into the stream."""
        for line in b"".join(frames).decode("utf-8", "replace").splitlines():
            reply = self._reply(line.strip(), t_ns)
            if reply:
                self.push(t_ns + self.leg_ns(), (f"{reply}\r\n".encode(),))
        return None

    def _reply(self, line: str, t_ns: int) -> str:
        parts = dict(piece.split('="', 1) for piece in line.split('" ')[:-1] if '="' in piece)
        values = {key.split()[-1]: value for key, value in parts.items()}
        name = values.get("ID", "")
        if line.startswith("<GET"):
            return self._get(name, t_ns)
        if name.startswith("ENABLE_SEND_"):
            stream = name.removeprefix("ENABLE_SEND_")
            on = values.get("STATE") == "1"
            (self._enabled.add if on else self._enabled.discard)(stream)
            return f'<ACK ID="{name}" STATE="{int(on)}" />'
        if name == "USER_DATA":
            self._user = values.get("VALUE", "")
            self.annotations.append(self._user)
            return f'<ACK ID="USER_DATA" VALUE="{self._user}" DUR="{values.get("DUR", "")}" />'
        if name == "CALIBRATE_START":
            self._calibration_ns = t_ns if values.get("STATE") == "1" else None
            self._open = []
        if name in ("CALIBRATE_START", "CALIBRATE_SHOW"):
            return f'<ACK ID="{name}" STATE="{values.get("STATE", "0")}" />'
        return f'<NACK ID="{name}" />'

    def _get(self, name: str, t_ns: int) -> str:
        if name == "API_ID":
            version = self.source.claimed_version(t_ns, NEWEST_API)
            return f'<ACK ID="API_ID" VALUE="{version}" />'
        if name == "PRODUCT_ID":
            rate_hz = round(self.source.rate_hz)
            return f'<ACK ID="PRODUCT_ID" VALUE="GP3" BUS="USB2" RATE="{rate_hz}" />'
        if name == "SERIAL_ID":
            return '<ACK ID="SERIAL_ID" VALUE="SIM0001" />'
        if name == "TRACKER_ID":
            search = "GAZE" if self.trackers > 1 else "NONE"
            return (
                f'<ACK ID="TRACKER_ID" ACTIVE_ID="1" MAX_ID="{self.trackers}" SEARCH="{search}" />'
            )
        if name == "TIME_TICK_FREQUENCY":
            bits = int.from_bytes(struct.pack("<d", self.ticks_per_s), "little")
            return f'<ACK ID="TIME_TICK_FREQUENCY" FREQ="{bits}" />'
        return f'<NACK ID="{name}" />'

    def _record(self, shot: Shot) -> str:
        ticks = shot.t_device_ns * self.ticks_per_s // NS_PER_S
        fields = [f'CNT="{shot.number}"', f'TIME="{shot.t_device_ns / NS_PER_S:.5f}"']
        fields.append(f'TIME_TICK="{ticks}"')
        points = []
        dx, dy, dz = self._moved_m(shot.t_ns)
        eyes = (
            ("L", -EYE_X_M, shot.left, shot.left_seen),
            ("R", EYE_X_M, shot.right, shot.right_seen),
        )
        for eye, x_m, ray, is_seen in eyes:
            x, y = self._screen.shares_of((dx + x_m, dy, dz), ray)
            is_seen = is_seen and x == x
            points.append((x, y) if is_seen else None)
            px, py = (x, y) if is_seen else (0.0, 0.0)
            fields.append(f'{eye}POGX="{px:.6f}" {eye}POGY="{py:.6f}" {eye}POGV="{int(is_seen)}"')
        seen_points = [p for p in points if p is not None]
        n = max(1, len(seen_points))
        bx, by = sum(x for x, _ in seen_points) / n, sum(y for _, y in seen_points) / n
        fields.append(f'BPOGX="{bx:.6f}" BPOGY="{by:.6f}" BPOGV="{int(bool(seen_points))}"')
        cx, cy, cz = self._camera
        for eye, x_m, _, is_seen in eyes:
            px, py, pz = dx + x_m - cx, dy - cy, dz - cz
            at = f'{eye}EYEX="{px:.6f}" {eye}EYEY="{py:.6f}" {eye}EYEZ="{pz:.6f}"'
            pupil_m = shot.pupil_mm * 1e-3 if is_seen else 0.0
            fields.append(f'{at} {eye}PUPILD="{pupil_m:.8f}" {eye}PUPILV="{int(is_seen)}"')
        fields.append(f'USER="{self._user}"')
        self._user = ""
        return f"<REC {' '.join(fields)} />\r\n"

    def _finish_calibration(self, end_ns: int) -> None:
        self._calibration_ns = None
        per_point = max(1, len(self._open) // len(CALIBRATION_POINTS))
        fields = []
        any_seen = False
        for i, (x, y) in enumerate(CALIBRATION_POINTS):
            samples = self._open[i * per_point : (i + 1) * per_point] or [(False, False)]
            fields.append(f'CALX{i + 1}="{x:.5f}" CALY{i + 1}="{y:.5f}"')
            for k, eye in enumerate("LR"):
                valid = sum(s[k] for s in samples) * 2 > len(samples)
                any_seen = any_seen or valid
                dx, dy = self._splits.normal(0.0, 0.005, 2)
                fields.append(f'{eye}X{i + 1}="{x + dx:.5f}" {eye}Y{i + 1}="{y + dy:.5f}"')
                fields.append(f'{eye}V{i + 1}="{int(valid)}"')
        if any_seen:
            self.source.calibrated_fit = self.source.body.fit()
        line = f'<CAL ID="CALIB_RESULT" {" ".join(fields)} />\r\n'
        self.push(end_ns, (line.encode(),))

"""An LSL gaze stream of a body, in memory.

Written from the XDF wiki's gaze meta-data and TittaLSL's source. Not modelled: LSL's discovery and
recovery, other streams of a session.
"""

import struct
from typing import Any, Unpack
from xml.etree.ElementTree import Element, SubElement, tostring

from visavis.devices.contracts import GAZE, Body
from visavis.devices.drivers.streaming.screen import Screen
from visavis.devices.sim.gaze.source import EYE_X_M, GazePeer, Measuring, Shot
from visavis.devices.transports import Frames
from visavis.lab.clock import NS_PER_S
from visavis.lab.xdf_channels import describe

NAN = float("nan")
OFFSET = struct.Struct("<dd")
ROUND_TRIP_NS = 200_000
TRACKER_BELOW_MM = 25.0
"""How far below the screen's lower edge a Tobii tracker, its own origin, sits."""


def titta_rows() -> list[dict[str, str]]:
    """Return the channels as TittaLSL describes them: 42, and one more is sent."""
    rows = []
    for eye in ("left", "right"):
        for label, kind, unit in (
            *((f"{a}.position_on_display_area.gaze_point", "Screen", "normalized") for a in "xy"),
            *(
                (f"{a}.position_in_user_coordinates.gaze_point", "Intersection", "mm")
                for a in "xyz"
            ),
            ("valid.gaze_point", "ValidFlag", "bool"),
            ("available.gaze_point", "AvailableFlag", "bool"),
            ("diameter.pupil", "Diameter", "mm"),
            ("valid.pupil", "ValidFlag", "bool"),
            ("available.pupil", "AvailableFlag", "bool"),
            *((f"{a}.position_in_user_coordinates.gaze_origin", "Pupil", "mm") for a in "xyz"),
            *(
                (f"{a}.position_in_track_box_coordinates.gaze_origin", "Pupil", "normalized")
                for a in "xyz"
            ),
            ("valid.gaze_origin", "ValidFlag", "bool"),
            ("available.gaze_origin", "AvailableFlag", "bool"),
            ("diameter.eye_openness", "EyeLidDistance", "mm"),
            ("valid.eye_openness", "ValidFlag", "bool"),
            ("available.eye_openness", "AvailableFlag", "bool"),
        ):
            axis = label[0].upper() if kind in ("Screen", "Intersection", "Pupil") else ""
            row = {"label": f"{label}.{eye}_eye", "eye": eye, "type": kind + axis, "unit": unit}
            rows.append(row)
    return rows


LAYOUTS = ("xdf", "screen", "titta")


class LslGazeSimulator(GazePeer):
    """Send samples of one layout: our own outlets' names, points on a screen, or TittaLSL's."""

    is_calibrated_before = True

    def __init__(
        self,
        body: Body,
        *,
        layout: str = "xdf",
        screen: Screen | None = None,
        **measuring: Unpack[Measuring],
    ) -> None:
        super().__init__(body, **measuring)
        self.layout = layout
        self._screen = screen or Screen()

    def to_message(self, shot: Shot) -> Frames:
        """Return a sample: stamp and numbers as doubles."""
        if shot.garbage is not None:
            return b"sample", shot.garbage
        values = self.values(shot)
        stamp_s = shot.t_device_ns / NS_PER_S
        return b"sample", struct.pack(f"<{len(values) + 1}d", stamp_s, *values)

    def answer(self, frames: Frames, t_ns: int) -> Frames | None:
        """Answer as liblsl does: the XML, or a clock offset."""
        if frames[0] == b"info":
            return b"info", self.xml()
        if frames[0] == b"time":
            offset_s = (t_ns - self.source.device_ns(t_ns)) / NS_PER_S
            return b"time", OFFSET.pack(offset_s, ROUND_TRIP_NS / NS_PER_S)
        return None

    def values(self, shot: Shot) -> list[float]:
        """Return a sample's numbers in this layout's order."""
        if self.layout == "xdf":
            return self._xdf(shot)
        values: list[float] = []
        eyes = ((-EYE_X_M, shot.left, shot.left_seen), (EYE_X_M, shot.right, shot.right_seen))
        for x_m, ray, is_seen in eyes:
            at = (x_m, 0.0, 0.0)
            x, y = self._screen.shares_of(at, ray) if is_seen else (NAN, NAN)
            if self.layout == "screen":
                values += [x, y, shot.pupil_mm if is_seen else NAN]
                continue
            cx, cy, cz = self._screen.point_m(0.5, 0.5)
            cy -= self._screen.height_mm * 0.5e-3 + TRACKER_BELOW_MM * 1e-3
            px, py, pz = self._screen.point_m(x, y)
            point = [(px - cx) * 1e3, (py - cy) * 1e3, (pz - cz) * 1e3]
            origin = [(x_m - cx) * 1e3, -cy * 1e3, -cz * 1e3] if is_seen else [NAN] * 3
            valid = float(is_seen)
            pupil = [shot.pupil_mm if is_seen else NAN, valid, 1.0]
            box = [0.5, 0.5, 0.5] if is_seen else [NAN] * 3
            no_openness = [0.0, 0.0, 0.0]
            values += [x, y, *point, valid, 1.0, *pupil, *origin, *box, valid, 1.0, *no_openness]
        return values if self.layout == "screen" else [*values, shot.t_device_ns / NS_PER_S]

    def desc(self) -> Element:
        """Return the channels' meta-data."""
        desc = Element("desc")
        if self.layout == "xdf":
            describe(desc, GAZE)
            return desc
        channels = SubElement(desc, "channels")
        rows = titta_rows()
        if self.layout == "screen":
            rows = []
            for eye in ("left", "right"):
                for kind, unit in (
                    ("ScreenX", "normalized"),
                    ("ScreenY", "normalized"),
                    ("PupilDiameter", "millimeters"),
                ):
                    rows.append({"label": f"{eye}{kind}", "eye": eye, "type": kind, "unit": unit})
        for row in rows:
            channel = SubElement(channels, "channel")
            for tag, text in row.items():
                SubElement(channel, tag).text = text
        return desc

    def channel_count(self) -> int:
        """Return how many numbers a sample has."""
        count = len(self.desc().findall("./channels/channel"))
        return count + 1 if self.layout == "titta" else count

    def xml(self) -> bytes:
        """Return the stream's description as liblsl writes it."""
        root = Element("info")
        rows = {
            "name": "Tobii_gaze" if self.layout == "titta" else f"simulated {self.layout}",
            "type": "Gaze",
            "source_id": "sim-gaze",
            "channel_count": str(self.channel_count()),
            "nominal_srate": str(self.source.rate_hz),
        }
        for tag, text in rows.items():
            SubElement(root, tag).text = text
        root.append(self.desc())
        return tostring(root)

    def _xdf(self, shot: Shot) -> list[float]:
        rays = [shot.left if shot.left_seen else (NAN,) * 3]
        rays += [shot.right if shot.right_seen else (NAN,) * 3]
        seen_rays = [ray for ray in rays if ray[0] == ray[0]]
        mean = (
            [sum(axis) / len(seen_rays) for axis in zip(*seen_rays, strict=True)]
            if seen_rays
            else [NAN] * 3
        )
        length = sum(v * v for v in mean) ** 0.5
        direction = [v / length for v in mean]
        origin = [0.0, 0.0, 0.0] if seen_rays else [NAN] * 3
        used_eyes = shot.left_seen + 2 * shot.right_seen
        values = [
            *direction,
            *origin,
            float(bool(seen_rays)),
            float(used_eyes),
            0.9 if seen_rays else 0.0,
        ]
        for ray, is_seen in zip(rays, (shot.left_seen, shot.right_seen), strict=True):
            values += [*ray, float(is_seen), shot.pupil_mm if is_seen else NAN]
        return values


class TittaSimulator(LslGazeSimulator):
    """The stream that TittaLSL sends of a Tobii tracker."""

    def __init__(self, body: Body, **options: Any) -> None:
        super().__init__(body, layout="titta", **options)

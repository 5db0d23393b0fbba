"""The streams devices deliver: their fields, units and frames."""

from collections.abc import Sequence

from visavis.lab.schema import Field, StreamSchema

GAZE = StreamSchema(
    name="gaze",
    nominal_rate_hz=120.0,
    fields=(
        Field("direction_head", "f4", "1", "head", (3,), "combined gaze, unit vector; NaN if lost"),
        Field("origin_m", "f4", "m", "head", (3,), "where the combined ray starts"),
        Field("valid", "?", "", description="the combined ray may be used"),
        Field("eyes_used", "u1", "", description="bit 0 left, bit 1 right, in the combined ray"),
        Field("confidence_01", "f4", "1", description="the tracker's own confidence"),
        Field("left_direction_head", "f4", "1", "head", (3,), "left eye, unit vector; NaN if lost"),
        Field("left_valid", "?", ""),
        Field("left_pupil_mm", "f4", "mm", description="diameter; NaN if unknown"),
        Field("right_direction_head", "f4", "1", "head", (3,), "right eye; NaN if lost"),
        Field("right_valid", "?", ""),
        Field("right_pupil_mm", "f4", "mm", description="diameter; NaN if unknown"),
    ),
)
"""Canonical gaze: head frame, metres, right-handed, y up, −z forward; validity separate from value.

A driver whose device runs at another rate replaces `nominal_rate_hz` and keeps the fields.
"""

HEAD = StreamSchema(
    name="head",
    nominal_rate_hz=90.0,
    fields=(
        Field("position_m", "f4", "m", "world", (3,), "midpoint between the eyes"),
        Field("orientation_wxyz", "f4", "1", "world", (4,), "unit quaternion, −z forward"),
        Field("valid", "?", "", description="tracking was good"),
    ),
)
"""The head from which a frame is drawn, as foreseen for its light. `t_device_ns` is the session
time that the pose describes, `t_host_ns` that at which it was handed out: the frame's start."""

HEAD_MEASURED = StreamSchema(name="head_measured", nominal_rate_hz=90.0, fields=HEAD.fields)
"""The head as measured, not foreseen: `t_device_ns` is the session time that the pose describes.

The last stream of headsets that can say it; gaze is turned by it."""

FRAME_TIMING = StreamSchema(
    name="frame_timing",
    nominal_rate_hz=90.0,
    fields=(
        Field("frame", "i8", "", description="index of the frame, as in FrameInfo"),
        Field("pose_seq", "i8", "", description="row of the head stream it was drawn from"),
        Field("predicted_display_ns", "i8", "ns", description="when its light was to leave"),
        Field("t_submitted_ns", "i8", "ns", description="both images handed over; -1 if never"),
        Field("skipped", "u4", "", description="frames the display went on without, before it"),
        Field("timing_known", "?", "", description="the runtime's own account follows"),
        Field("presents", "u4", "", description="times the runtime showed it"),
        Field("mispresented", "u4", "", description="times shown at another sync than planned"),
        Field("runtime_dropped", "u4", "", description="times the one before was shown again"),
        Field("reprojection_flags", "u4", "", description="the runtime's own flags"),
        Field("render_gpu_ms", "f4", "ms", description="the runtime's own; NaN if unknown"),
    ),
)
"""The timing of every frame as reported by the headset's runtime, one row per frame, delivered with
the next frame; the second stream of headsets that report it."""

RESPONSES = StreamSchema(
    name="responses",
    nominal_rate_hz=0.0,
    fields=(
        Field("control", "u2", "", description="index into the device's list of controls"),
        Field("value_01", "f4", "1", description="1 pressed, 0 released, or an axis"),
    ),
)

POINTER = StreamSchema(
    name="pointer",
    nominal_rate_hz=0.0,
    fields=(
        Field("hand", "u1", "", description="0 left, 1 right"),
        Field("position_m", "f4", "m", "world", (3,), "where the ray starts"),
        Field("orientation_wxyz", "f4", "1", "world", (4,), "the ray runs along −z of it"),
        Field("valid", "?", "", description="the controller is tracked"),
    ),
)
"""The pose of a controller; the second stream of response devices that know it."""

HAPTICS = StreamSchema(
    name="haptics",
    nominal_rate_hz=0.0,
    fields=(
        Field("command", "u4", "", description="number of the command, from 0, per start"),
        Field("kind", "u1", "", description="0 set, 1 pattern, 2 silence, 3 keep-alive"),
        Field("t_commanded_ns", "i8", "ns", description="when the experiment asked"),
        Field(
            "t_sent_ns", "i8", "ns", description="when the last byte left; NO_DEVICE_TIME: never"
        ),
        Field("acknowledged", "?", "", description="the band confirmed; else lost or one-way"),
        Field("amplitudes_01", "f4", "1", shape=(4,), description="per motor; NaN if not there"),
        Field("rates_hz", "f4", "Hz", shape=(4,), description="vibration rate asked; NaN if none"),
        Field("duration_ms", "f4", "ms", description="time to live, or a pattern's length"),
        Field("pattern", "u1", "", description="index into PATTERN_NAMES; 255 none"),
        Field("low_hz", "f4", "Hz", description="lowest rate of a pattern; NaN if none"),
        Field("modulation_hz", "f4", "Hz", description="swings per second; NaN if none"),
    ),
)
"""One row per command, delivered when it is acknowledged or given up; `t_host_ns` is the arrival
of the acknowledgement (or the giving up), `t_device_ns` the band's own time of applying it, or
`NO_DEVICE_TIME` when that is unknown."""

SOUND = StreamSchema(
    name="sound",
    nominal_rate_hz=0.0,
    fields=(
        Field("sound", "i4", "", description="number of the sound, from 0, per start; -1: none"),
        Field("event", "u1", "", description="index into SOUND_EVENTS"),
        Field("t_commanded_ns", "i8", "ns", description="when the experiment asked"),
        Field("t_sounding_ns", "i8", "ns", description="when that sample leaves the card"),
        Field("stamped", "?", "", description="the card said when; else its usual latency"),
    ),
)
"""The events of every sound; `t_device_ns` is the card's own time of the event, `t_sounding_ns` the
same on the session's clock. Delays after the card are not included."""

SOUND_EVENTS = ("began", "ended", "stopped", "underflow")
"""Events of the `SOUND` stream by code: first sample, last sample, ended on command, and a hole in
everything that sounded."""

NO_DEVICE_TIME = -(2**63)
"""Value of `t_device_ns` if the device gave no time, of `t_sent_ns` if nothing was sent."""

BAND = StreamSchema(
    name="band",
    nominal_rate_hz=0.0,
    fields=(
        Field("event", "u1", "", description="index into BAND_EVENTS"),
        Field("battery_01", "f4", "1", description="charge; NaN if unknown"),
        Field(
            "electronics_temperature_c",
            "f4",
            "Cel",
            description="of die or board in degrees Celsius, not of the skin; NaN if unknown",
        ),
        Field(
            "skin_temperature_c",
            "f4",
            "Cel",
            description="between motors and skin in degrees Celsius; NaN without a sensor",
        ),
    ),
)
"""Reports of a band about itself: about once a second, and at every event."""

BAND_EVENTS = (
    "report",
    "boot",
    "dead_man",
    "expired",
    "battery_low",
    "battery_good",
    "too_hot",
    "cool_again",
    "pattern_ended",
    "motors_rest",
    "motors_rested",
    "held_too_long",
    "skin_sensor_lost",
)
"""Events of the `BAND` stream by code: a regular report, started anew, silenced for want of
frames, silenced at the end of a time to live, and so on."""


def body_schema(segments: Sequence[str], rate_hz: float, name: str = "body") -> StreamSchema:
    """Return the stream of a body tracker: every segment, every sample, in a fixed order."""
    n, segment_list = len(segments), " ".join(segments)
    return StreamSchema(
        name=name,
        nominal_rate_hz=rate_hz,
        fields=(
            Field("position_m", "f4", "m", "world", (n, 3), f"origins of: {segment_list}"),
            Field("orientation_wxyz", "f4", "1", "world", (n, 4), "identity in a T-pose to −z"),
            Field("valid", "?", "", shape=(n,), description="segment was tracked"),
        ),
    )

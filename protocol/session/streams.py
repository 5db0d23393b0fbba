"""The streams that the session itself records, besides those of the devices."""

from visavis.lab.schema import Field, StreamSchema
from visavis.stimuli.gaze_window import GAZE_WINDOW


def gaze_targets_schema(agent_count: int, rate_hz: float) -> StreamSchema:
    """Return the stream that says where every gaze sample fell in the scene shown.

    One row per gaze sample that arrived, in order of arrival; `gaze_seq` links it to the gaze
    stream. Per-agent columns follow the order of the scene's agents (event "scene").
    """
    m = (agent_count,)
    return StreamSchema(
        name="gaze_targets",
        nominal_rate_hz=rate_hz,
        fields=(
            Field("gaze_seq", "i8", "", description="seq of the sample in the gaze stream"),
            Field("frame_index", "i4", "", description="frame in which it was evaluated"),
            Field(
                "t_sample_ns",
                "i8",
                "ns",
                description="device time + clock offset - gaze_delay_ms",
            ),
            Field("valid", "?", "", description="the combined ray may be used"),
            Field("direction_world", "f4", "1", "world", (3,), "unit vector; NaN if lost"),
            Field("origin_world_m", "f4", "m", "world", (3,), "where the ray starts"),
            Field("angle_deg", "f4", "deg", shape=m, description="gaze ray to head centre"),
            Field("radius_deg", "f4", "deg", shape=m, description="angular radius of the head"),
            Field("pad_limit_deg", "f4", "deg", shape=m, description="half the gap to the next"),
            Field("hit", "i2", "", description="first head met: agent index, -1 none, -2 lost"),
            Field(
                "head_beyond_ms",
                "f4",
                "ms",
                description="sample after the last measured head pose; NaN: none was measured",
            ),
        ),
    )


FRAMES = StreamSchema(
    name="frames",
    nominal_rate_hz=90.0,
    fields=(
        Field("frame_index", "i4", "", description="the display's frame number"),
        Field("predicted_display_ns", "i8", "ns", description="when its light leaves"),
        Field("state", "u1", "", description="index into the session's states"),
        Field("trial_number", "i2", "", description="trial shown, -1 outside trials"),
        Field("scene_row", "i4", "", description="row of scene_states on display"),
        Field("dropped", "i2", "", description="frames the display skipped before this one"),
        Field("gaze_samples", "i2", "", description="gaze samples evaluated in this frame"),
    ),
)
"""One row per frame of the display; its rate is replaced by the headset's."""


GAZE_WINDOWS = StreamSchema(
    name=GAZE_WINDOW,
    nominal_rate_hz=0.0,
    fields=(
        Field("t_drawn_ns", "i8", "ns", description="the frame for which it was drawn began"),
        Field(
            "t_sample_ns",
            "i8",
            "ns",
            description="the sample of gaze (gaze_targets) that it follows; -1: gaze is lost",
        ),
        Field("valid", "?", "", description="false: gaze is lost, everything is covered"),
        Field("direction_world", "f4", "1", "world", (3,), "its middle; NaN if lost"),
        Field("origin_world_m", "f4", "m", "world", (3,), "the eye that looked there"),
        Field("delay_ms", "f4", "ms", description="from the sample to the frame; NaN if lost"),
    ),
)
"""Where a window was that follows gaze: a row for every place, at the first frame that showed it
there (`t_host_ns`)."""


def scene_states_schema(agent_count: int) -> StreamSchema:
    """Return the stream of everything drawn that changes: one row per change, not per frame."""
    m = agent_count
    return StreamSchema(
        name="scene_states",
        nominal_rate_hz=0.0,
        fields=(
            Field("scene", "i4", "", description="number of the static scene (event 'scene')"),
            Field("gaze_direction", "f4", "1", "world", (m, 3), "where each agent's eyes point"),
            Field("eye_openness_01", "f4", "1", shape=(m,), description="0 closed"),
            Field(
                "gaze_distance_m",
                "f4",
                "m",
                shape=(m,),
                description="from between the eyes to where both lines of gaze meet",
            ),
        ),
    )

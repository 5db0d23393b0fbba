"""No stream of Visavis is taken for one of a device of the lab's own."""

from visavis.analysis.own_streams import is_own_stream
from visavis.devices import streams as device_streams
from visavis.devices.drivers.streaming import openness
from visavis.lab.schema import StreamSchema
from visavis.protocol.session import streams as session_streams
from visavis.stage import frame_truth


def test_streams_of_visavis_are_not_of_the_labs_own_devices() -> None:
    modules = (device_streams, session_streams, frame_truth, openness)
    schemas = [v for m in modules for v in vars(m).values() if isinstance(v, StreamSchema)]
    schemas += [
        device_streams.body_schema(("head",), 100.0),
        session_streams.gaze_targets_schema(2, 120.0),
        session_streams.scene_states_schema(2),
        frame_truth.drawn_schema(2, 90.0),
    ]

    assert "head_measured" in {schema.name for schema in schemas}
    assert [] == [schema.name for schema in schemas if is_own_stream(schema.name)]
    assert is_own_stream("belt")

"""Name the channels of a stream as the XDF meta-data conventions do, for LSL and XDF alike.

Source: the XDF wiki's pages on Gaze, MoCap and Markers meta-data.
"""

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt

from visavis.lab.schema import Field, SampleBatch, StreamSchema

CONTENT_TYPES = {
    "gaze": "Gaze",
    "head": "MoCap",
    "head_measured": "MoCap",
    "body": "MoCap",
    "responses": "Markers",
}
"""Stream name -> content type; others are "Misc"."""

UNITS = {"m": "meters", "mm": "millimeters", "s": "seconds", "deg": "degrees", "1": "normalized"}
UNITS |= {"uV": "microvolts", "mV": "millivolts", "uS": "microsiemens", "Cel": "celsius"}
FRAMES = {"head": "head-space", "world": "world-space"}


@dataclass(frozen=True)
class Channel:
    """One number of a stream; `eye`, `frame` and `segment` are empty where they mean nothing."""

    label: str
    kind: str
    unit: str
    eye: str
    frame: str
    segment: str = ""


def channels_of(schema: StreamSchema) -> tuple[Channel, ...]:
    """Return the channels of a stream, in the order of `flat_values`."""
    is_gaze = schema.name == "gaze"
    segments = segments_of(schema)
    return tuple(c for field in schema.fields for c in _of_field(field, is_gaze, segments))


def segments_of(schema: StreamSchema) -> tuple[str, ...]:
    """Return the names of a body stream's segments; empty for other streams."""
    if schema.name != "body" or not schema.fields:
        return ()
    return tuple(schema.fields[0].description.partition("origins of: ")[2].split())


def content_type(schema: StreamSchema) -> str:
    """Return the XDF content type of a stream."""
    return CONTENT_TYPES.get(schema.name, "Misc")


def flat_values(batch: SampleBatch) -> npt.NDArray[np.float64]:
    """Return a batch's numbers, shape (n, channels); flags are 0 and 1, missing stays NaN."""
    return flat_columns(batch.schema, {f.name: batch.values[f.name] for f in batch.schema.fields})


def flat_columns(
    schema: StreamSchema, columns: dict[str, npt.NDArray[np.generic]]
) -> npt.NDArray[np.float64]:
    """Return a stream's columns as numbers, shape (n, channels)."""
    parts = []
    for field in schema.fields:
        column = columns[field.name]
        parts.append(column.reshape(len(column), _size(field)).astype(np.float64))
    return np.concatenate(parts, axis=1) if parts else np.empty((0, 0))


def describe(target: Element, schema: StreamSchema) -> None:
    """Write the channels of a stream below an XML `desc` element."""
    channels = SubElement(target, "channels")
    for channel in channels_of(schema):
        entry = SubElement(channels, "channel")
        for tag, text in (
            ("label", channel.label),
            ("eye", channel.eye),
            ("type", channel.kind),
            ("unit", channel.unit),
            ("coordinate_system", channel.frame),
            ("object", channel.segment),
        ):
            if text:
                SubElement(entry, tag).text = text


def _of_field(field: Field, is_gaze: bool, segments: tuple[str, ...]) -> list[Channel]:
    n = _size(field)
    eye = ""
    if is_gaze:
        first = field.name.partition("_")[0]
        eye = first if first in ("left", "right") else "both"
    unit, frame = UNITS.get(field.unit, field.unit), FRAMES.get(field.frame, field.frame)
    last = field.shape[-1] if field.shape else 1
    axes, kind = [""], _scalar_kind(field)
    if last == 3:
        axes, kind = list("XYZ"), "Direction" if "direction" in field.name else "Position"
    elif last == 4 and field.name.endswith("_wxyz"):
        axes, kind, unit = list("ABCD"), "Orientation", "quaternion"
    elif n > 1:
        axes = [""] * last
    channels = []
    for i in range(n):
        axis = axes[i % len(axes)]
        label = field.name if n == 1 else f"{field.name}_{i // last}_{axis or i % last}"
        if n == last and n > 1:
            label = f"{field.name}_{axis or i}"
        per_segment = n // len(segments) if segments else 1
        segment = segments[i // per_segment] if segments else ""
        channels.append(Channel(label, f"{kind}{axis}", unit, eye, frame, segment))
    return channels


def _size(field: Field) -> int:
    return int(np.prod(field.shape)) if field.shape else 1


def _scalar_kind(field: Field) -> str:
    if "pupil" in field.name:
        return "PupilDiameter"
    if "confidence" in field.name:
        return "Confidence"
    return "Valid" if field.dtype == "?" else "Misc"

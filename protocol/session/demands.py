"""Whether a lab's devices can do what a study demands, asked once they are open."""

from collections.abc import Collection, Iterator, Mapping, Sequence

from visavis.devices.contracts import Armband, Fault, VibrationPattern
from visavis.protocol.plan.experiment import Demands


def unmet(
    demands: Demands,
    segments: Sequence[str],
    bands: Mapping[str, Armband],
    without: Collection[str] = (),
) -> Iterator[Fault]:
    """Yield a blocking fault for everything the open devices cannot do.

    Devices that the operator goes on `without` are not checked.
    """
    missing = [name for name in demands.segments if name not in segments]
    if missing and "body_tracker" not in without:
        yield Fault(
            "body_tracker",
            "blocking",
            f"the study needs {', '.join(missing)}, which this tracker does not deliver",
            "put a sensor there and name it under devices.body_tracker in lab_config.yaml",
        )
    for role, pattern in demands.vibrations.items():
        band = bands.get(role)
        if band is None:
            continue
        if demands.motors and max(demands.motors) >= band.motor_count:
            yield Fault(
                role,
                "blocking",
                f"the study drives {max(demands.motors) + 1} motors, this band has "
                f"{band.motor_count}",
                "give the role a band with more motors",
            )
        yield from _beyond(role, pattern, band.rate_range_hz)


def _beyond(role: str, pattern: VibrationPattern, range_hz: tuple[float, float]) -> Iterator[Fault]:
    """Compare a pattern with what a band can do; NaN where the band cannot tell."""
    low_hz, high_hz = range_hz
    if pattern.low_hz < low_hz or pattern.high_hz > high_hz:
        yield Fault(
            role,
            "blocking",
            f"the study's vibration swings from {pattern.low_hz:g} to {pattern.high_hz:g} Hz, this "
            f"band does {low_hz:g} to {high_hz:g} Hz",
            "set the study's pattern rates within that, in a new study folder",
        )

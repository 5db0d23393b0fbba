"""Errors of motion data."""

from visavis.lab.errors import DataError


class MotionError(DataError):
    """Key poses, clips or skeletons are unusable or do not fit together."""


class UnknownJointsError(MotionError):
    """Required joints are `missing`: none of `names` is recognised as one of them."""

    def __init__(self, missing: tuple[str, ...], names: tuple[str, ...]) -> None:
        super().__init__(
            f"joints not recognised: {', '.join(missing)}; among {', '.join(names)}. "
            "Pass joint_map with our names and yours"
        )
        self.missing, self.names = missing, names


class BvhError(MotionError):
    """A BVH file is broken; `line` counts from 1."""

    def __init__(self, name: str, line: int, message: str, remedy: str) -> None:
        super().__init__(f"{name} line {line}: {message}; {remedy}")
        self.line = line

"""Small tidy frames for the tests, as mappings of columns."""

from typing import Any

import numpy as np

Frame = dict[str, Any]


def within_frame(seed: int = 0, n: int = 8, levels: tuple[int, int] = (2, 3)) -> Frame:
    """Return a complete two-factor within design with effects and subject differences."""
    rng = np.random.default_rng(seed)
    k, m = levels
    subject = np.repeat([f"S{i:02d}" for i in range(n)], k * m)
    a = np.tile(np.repeat([f"a{i}" for i in range(k)], m), n)
    b = np.tile([f"b{i}" for i in range(m)], n * k)
    y = rng.normal(size=n * k * m) + np.repeat(rng.normal(size=n), k * m)
    y += 0.8 * (b == "b1") + 0.5 * (a == "a1")
    return {"subject": subject, "A": a, "B": b, "y": y}


def mixed_frame(seed: int = 0, sizes: tuple[int, ...] = (5, 7)) -> Frame:
    """Return a between-by-within design with groups of the given sizes."""
    frame = within_frame(seed, sum(sizes), (1, 3))
    groups = np.repeat([f"g{i}" for i in range(len(sizes))], sizes)
    frame["G"] = np.repeat(groups, 3)
    frame["y"] = frame["y"] + 0.7 * (frame["G"] == "g1")
    del frame["A"]
    return frame


def rows(frame: Frame, index: Any) -> Frame:
    """Return some rows of a frame, in the order of the index."""
    return {name: np.asarray(column)[index] for name, column in frame.items()}


def changed(frame: Frame, column: str, row: int, value: object) -> Frame:
    """Return a frame with one value replaced."""
    values = list(frame[column])
    values[row] = value
    return {**frame, column: values}

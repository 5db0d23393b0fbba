"""Batches of samples as a page in a headset sends them."""

import base64
from typing import Any

import numpy as np

POSE = (0.1, 1.6, -0.2, 1.0, 0.0, 0.0, 0.0)
FRAME_MS = 1000 / 72


def head_rows(n: int, every_ms: float = FRAME_MS) -> list[tuple[float, ...]]:
    """Return rows of a head that stands still."""
    return [(i * every_ms, *POSE, 1.0) for i in range(n)]


def batch(
    rows: list[tuple[float, ...]],
    stream: str = "head",
    *,
    seq0: int = 0,
    t0_ms: float = 5000.0,
    **more: Any,
) -> dict[str, Any]:
    """Return an event with rows of a stream, closed with its last row; its number is missing."""
    return {
        "kind": "stream",
        "stream": stream,
        "seq0": seq0,
        "rows": len(rows),
        "t0_ms": t0_ms,
        "at_ms": t0_ms + (rows[-1][0] if rows else 0.0),
        "data": base64.b64encode(np.array(rows, "<f4").tobytes()).decode(),
        "rate_hz": 72.0,
        **({"xr0_ms": 900.0} if stream == "frame_timing" else {}),
    } | more

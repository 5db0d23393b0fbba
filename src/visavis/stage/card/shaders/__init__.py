"""The programs of the graphics card: pieces in GLSL beside this file, and what they make together.

Each module here puts pieces one after another; what the processor must know of them, too, is
written into them from there.
"""

from pathlib import Path


def source(piece: str) -> str:
    """Return the text of a piece: of the file of that name."""
    return "\n" + (Path(__file__).parent / f"{piece}.glsl").read_text("utf-8")

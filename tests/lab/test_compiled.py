"""Compiled kernels: what is cached is used again, and never after what it rests on has changed."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
INNER = "from lab.compiled import compiled\n\n\n@compiled\ndef inner(x):\n    return x + {}\n"
OUTER = """
from inner_kernel import inner
from numbers_taken_in import SHIFT
from lab.compiled import compiled


@compiled
def outer(x):
    return 10 * inner(x) + SHIFT


print(outer(1), sum(outer.stats.cache_hits.values()))
"""


def outer_of(folder: Path, *, added: int, shift: int) -> tuple[int, int]:
    """Return what the outer kernel gives in a new process, and how often its cache was used."""
    for name, text in (
        ("inner_kernel", INNER.format(added)),
        ("numbers_taken_in", f"SHIFT = {shift}\n"),
        ("outer_kernel", OUTER),
    ):
        path = folder / f"{name}.py"
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
    path_line = f"import sys; sys.path[:0] = [{str(folder)!r}, {str(ROOT)!r}]"
    done = subprocess.run(
        [sys.executable, "-B", "-c", f"{path_line}; import outer_kernel"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    value, hits = done.stdout.split()
    return int(value), int(hits)


def test_cached_code_is_used_until_a_kernel_or_number_it_takes_in_changes(tmp_path: Path) -> None:
    assert outer_of(tmp_path, added=1, shift=0) == (20, 0)
    assert outer_of(tmp_path, added=1, shift=0) == (20, 1)
    assert outer_of(tmp_path, added=1000, shift=0) == (10010, 0)
    assert outer_of(tmp_path, added=1000, shift=5) == (10015, 0)
    assert outer_of(tmp_path, added=1000, shift=5) == (10015, 1)

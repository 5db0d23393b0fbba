"""BVH files as they are: joints, channels and numbers, in the file's own units and degrees.

Any channel order and any subset of the six channels per joint. Reading what `format_bvh` wrote
gives the same numbers back.
"""

from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import UsageError
from visavis.lab.geometry import Vector
from visavis.lab.plain_files import read_plain
from visavis.stimuli.motion.errors import BvhError, MotionError

CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
MAX_BYTES = 1 << 30
_CANONICAL = {name.lower(): name for name in CHANNELS}


@dataclass(frozen=True)
class BvhJoint:
    """One joint: `parent` is its index or −1, `end` the offset of its End Site or None.

    Offsets are in the file's unit; `channels` in file order, such as ("Zrotation", "Yrotation").
    """

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...]
    end: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Bvh:
    """A whole file: `values` (frames, all channels in file order), lengths and degrees."""

    joints: tuple[BvhJoint, ...]
    frame_time_s: float
    values: Vector


def read_bvh(path: Path) -> Bvh:
    """Read a BVH file.

    Raises:
        BvhError: the file is empty, cut off or broken; names file and line.
        UsageError: there is no such file.
        MotionError: it cannot be read.
    """
    try:
        raw = read_plain(path, max_bytes=MAX_BYTES)
    except FileNotFoundError as error:
        raise UsageError(f"there is no file {path}") from error
    except OSError as error:
        raise MotionError(f"{path}: {error.strerror}; check the path and its rights") from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise BvhError(str(path), line, "is not text", "give a BVH file, saved as UTF-8") from error
    return parse_bvh(text, str(path))


def parse_bvh(text: str, name: str = "BVH text") -> Bvh:
    """Read the text of a BVH file; `name` appears in messages.

    Raises:
        BvhError: the text is empty, cut off or broken.
    """
    lines = text.replace("\r\n", "\n").replace("\r", "\n").rstrip().split("\n")
    if not text.strip():
        raise BvhError(name, 1, "the file is empty", "export or copy it again")
    reader = _Hierarchy(name, lines)
    joints = reader.joints()
    n_channels = sum(len(j.channels) for j in joints)
    if n_channels == 0:
        raise BvhError(name, reader.line, "no joint has channels", "export it with motion")
    n_frames, frame_time_s, first = _motion_header(name, lines, reader.motion_line)
    values = _values(name, lines, first, n_frames, n_channels)
    return Bvh(joints, frame_time_s, values)


class _Hierarchy:
    """Walks over the words of the HIERARCHY section and remembers the line it is at."""

    def __init__(self, name: str, lines: list[str]) -> None:
        self._name = name
        self._lines = lines
        self._words: deque[str] = deque()
        self.line = 0
        self.motion_line = 0

    def _fail(self, message: str, remedy: str = "correct or export the file again") -> BvhError:
        return BvhError(self._name, max(self.line, 1), message, remedy)

    def _next(self, what: str) -> str:
        while not self._words:
            if self.line >= len(self._lines):
                raise self._fail(f"the file ends where {what} should stand", "copy it again")
            line = self._lines[self.line].replace("{", " { ").replace("}", " } ")
            self._words = deque(line.split())
            self.line += 1
        return self._words.popleft()

    def _demand(self, word: str) -> None:
        word_read = self._next(word)
        if word_read.upper() != word:
            raise self._fail(f"{word_read[:40]!r} instead of {word}")

    def _numbers(self, what: str) -> tuple[float, float, float]:
        numbers = []
        for _ in range(3):
            word = self._next(f"a number of {what}")
            value = _number(word)
            if value is None:
                raise self._fail(f"{what} has {word[:40]!r} in place of a number", _REMEDY)
            numbers.append(value)
        return numbers[0], numbers[1], numbers[2]

    def _joint_name(self) -> str:
        """Take the rest of the line: some programs write names with blanks."""
        words = []
        while self._words and self._words[0] != "{":
            words.append(self._words.popleft())
        if not words:
            raise self._fail("a joint has no name")
        return " ".join(words)

    def _channels(self) -> tuple[str, ...]:
        word = self._next("the number of channels")
        if word not in tuple("0123456"):
            raise self._fail(f"{word[:40]!r} channels announced; a joint has 0 to 6")
        channels: list[str] = []
        for _ in range(int(word)):
            channel = self._next("a channel")
            if channel.lower() not in _CANONICAL:
                raise self._fail(
                    f"unknown channel {channel[:40]!r}", f"use {', '.join(CHANNELS)}, as announced"
                )
            channels.append(_CANONICAL[channel.lower()])
        if len(set(channels)) != len(channels):
            raise self._fail(f"a channel appears twice in {' '.join(channels)}")
        return tuple(channels)

    def joints(self) -> tuple[BvhJoint, ...]:
        """Read everything up to the line MOTION."""
        self._demand("HIERARCHY")
        self._demand("ROOT")
        joints: list[BvhJoint] = []
        line_of_name: dict[str, int] = {}
        above: list[int] = []
        self._open(joints, line_of_name, above)
        while above:
            word = self._next("JOINT or }").upper()
            if word == "JOINT":
                self._open(joints, line_of_name, above)
            elif word == "END":
                self._end_site(joints, above[-1])
            elif word == "}":
                above.pop()
            else:
                raise self._fail(f"{word[:40]!r} instead of JOINT, End Site or }}")
        word = self._next("MOTION").upper()
        if word == "ROOT":
            raise self._fail("a second ROOT", "keep one person per file")
        if word != "MOTION":
            raise self._fail(f"{word[:40]!r} instead of MOTION")
        self.motion_line = self.line
        return tuple(joints)

    def _open(self, joints: list[BvhJoint], line_of_name: dict[str, int], above: list[int]) -> None:
        name = self._joint_name()
        if name in line_of_name:
            raise self._fail(
                f"joint {name!r} appears twice, first in line {line_of_name[name]}",
                "rename one of them",
            )
        line_of_name[name] = self.line
        self._demand("{")
        self._demand("OFFSET")
        offset = self._numbers(f"the OFFSET of {name!r}")
        self._demand("CHANNELS")
        joints.append(BvhJoint(name, above[-1] if above else -1, offset, self._channels()))
        above.append(len(joints) - 1)

    def _end_site(self, joints: list[BvhJoint], at: int) -> None:
        joint = joints[at]
        self._demand("SITE")
        # Some programs name their End Sites; the name carries nothing.
        while self._words and self._words[0] not in ("{", "}"):
            self._words.popleft()
        self._demand("{")
        self._demand("OFFSET")
        end = self._numbers(f"the End Site of {joint.name!r}")
        self._demand("}")
        if joint.end is not None:
            raise self._fail(f"joint {joint.name!r} has two End Sites", "remove one")
        joints[at] = BvhJoint(joint.name, joint.parent, joint.offset, joint.channels, end)


_REMEDY = "write numbers with a decimal point, or cut the motion before this place"


def _number(word: str) -> float | None:
    """Return a finite number, or None."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if np.isfinite(value) and "_" not in word else None


def _motion_header(name: str, lines: list[str], at: int) -> tuple[int, float, int]:
    """Return number of frames, frame time and the index of the first line with numbers."""
    entries: list[tuple[int, str]] = []
    for key in ("frames:", "frame time:"):
        while at < len(lines) and not lines[at].strip():
            at += 1
        if at >= len(lines):
            raise BvhError(name, at, f"the file ends before {key!r}", "copy it again")
        words = " ".join(lines[at].split()).replace(" :", ":", 1)
        if not words.lower().startswith(key):
            raise BvhError(name, at + 1, f"{words[:40]!r} instead of {key!r}", "correct it")
        at += 1
        entries.append((at, words[len(key) :].strip()))
    (line, count), (time_line, time) = entries
    if not count.isdecimal() or len(count) > 12:
        raise BvhError(name, line, f"{count[:40]!r} frames announced", "write a whole number")
    if int(count) == 0:
        raise BvhError(name, line, "the file holds no frames", "export it with motion")
    frame_time_s = _number(time)
    if frame_time_s is None or frame_time_s <= 0:
        raise BvhError(
            name, time_line, f"frame time {time[:40]!r}", "write seconds per frame, above 0"
        )
    return int(count), frame_time_s, at


def _values(name: str, lines: list[str], first: int, n_frames: int, n_channels: int) -> Vector:
    rows = [(i + 1, words) for i in range(first, len(lines)) if (words := lines[i].split())]
    total = sum(len(words) for _, words in rows)
    if total != n_frames * n_channels or any(len(words) != n_channels for _, words in rows):
        _explain(name, rows, n_frames, n_channels, max(first, 1))
    flat = [word for _, words in rows for word in words]
    try:
        values: Vector = np.array(flat, dtype=np.float64)
    except ValueError:
        values = np.array([np.nan])
    if not np.isfinite(values).all() or any("_" in word for word in flat):
        line, word, column = next(
            (line, word, column)
            for line, words in rows
            for column, word in enumerate(words, start=1)
            if _number(word) is None
        )
        raise BvhError(name, line, f"value {column} is {word[:40]!r}, not a number", _REMEDY)
    return values.reshape(n_frames, n_channels)


def _explain(
    name: str, rows: list[tuple[int, list[str]]], n_frames: int, n_channels: int, line: int
) -> None:
    """Raise for a wrong count of values, unless frames are only wrapped over several lines."""
    total = sum(len(words) for _, words in rows)
    odd = next(((at, len(words)) for at, words in rows if len(words) != n_channels), None)
    if total == n_frames * n_channels and odd is not None and odd[1] < n_channels:
        return
    if odd is not None:
        raise BvhError(
            name,
            odd[0],
            f"{odd[1]} values in a frame of {n_channels} channels",
            "the file is cut off or the channels are wrong: copy or export it again",
        )
    raise BvhError(
        name,
        rows[-1][0] if rows else line,
        f"{len(rows)} frames in the file, {n_frames} announced",
        "copy the file again, or correct the number of frames",
    )


def format_bvh(bvh: Bvh, *, decimals: int | None = None) -> str:
    """Return the text of a BVH file, numbers with `decimals` digits or as exact as they are.

    Raises:
        MotionError: the joints and values do not form a BVH file.
    """
    n_channels = sum(len(j.channels) for j in bvh.joints)
    if bvh.values.ndim != 2 or bvh.values.shape[1] != n_channels or not len(bvh.values):
        raise MotionError(f"values {bvh.values.shape} do not fit {n_channels} channels")

    def text_of(value: float) -> str:
        if decimals is None:
            return repr(float(value))
        number = round(float(value), decimals) + 0.0  # no negative zero in print
        return f"{number:.{decimals}f}"

    lines = ["HIERARCHY"]
    above: list[int] = []

    def put(text: str) -> None:
        lines.append("\t" * len(above) + text)

    def close_to(depth: int) -> None:
        while len(above) > depth:
            joint = bvh.joints[above[-1]]
            if joint.end is not None:
                end = " ".join(map(text_of, joint.end))
                put("End Site")
                put("{")
                lines.append("\t" * (len(above) + 1) + f"OFFSET {end}")
                put("}")
            above.pop()
            put("}")

    for i, joint in enumerate(bvh.joints):
        if (joint.parent == -1) != (i == 0) or (i and joint.parent not in (*above,)):
            raise MotionError(f"joint {joint.name!r} does not follow its parent in file order")
        close_to(above.index(joint.parent) + 1 if i else 0)
        put(f"{'JOINT' if i else 'ROOT'} {joint.name}")
        put("{")
        above.append(i)
        put("OFFSET " + " ".join(map(text_of, joint.offset)))
        put(" ".join(["CHANNELS", str(len(joint.channels)), *joint.channels]))
    close_to(0)
    lines += ["MOTION", f"Frames: {len(bvh.values)}", f"Frame Time: {bvh.frame_time_s!r}"]
    lines += [" ".join(map(text_of, row)) for row in bvh.values.tolist()]
    return "\n".join(lines) + "\n"


def write_bvh(path: Path, bvh: Bvh, *, decimals: int | None = None) -> None:
    """Write a new BVH file.

    Raises:
        MotionError: the file is already there or cannot be written.
    """
    text = format_bvh(bvh, decimals=decimals)
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileNotFoundError as error:
        raise UsageError(f"there is no file {path}") from error
    except OSError as error:
        raise MotionError(f"{path}: {error.strerror}; choose another name or folder") from error


def channel_columns(bvh: Bvh) -> list[npt.NDArray[np.int64]]:
    """Return for every joint the columns of its channels in `values`."""
    ends = np.cumsum([len(j.channels) for j in bvh.joints])
    return [np.arange(end - len(j.channels), end) for j, end in zip(bvh.joints, ends, strict=True)]

"""Films of a lab's own files: what a file holds, and its pictures, decoded ahead of their time."""

import queue
import threading
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from visavis.lab.errors import DesignError
from visavis.lab.geometry import Vector
from visavis.stimuli.flat import Panorama, Video, picture_path

Pixels = npt.NDArray[np.uint8]
Content = TypeVar("Content")
"""What a reader makes of the pixels of a picture."""
MAX_FILE_BYTES: Final = 500_000_000
MAX_SIZE_PX: Final = 4096
MAX_AROUND_PX: Final = 2 * MAX_SIZE_PX
"""Of a film all around, in which two eyes' pictures may lie beside each other."""
CUT_S: Final = 0.25
"""Files whose pictures end earlier than they say by more are cut short."""
AHEAD_BYTES: Final = 96 << 20
MIN_AHEAD, MAX_AHEAD = 3, 30
"""Pictures that are decoded ahead."""
HIGH_DEFINITION_PX: Final = 720
"""From this height on the colours of films that name none are those of ITU-R BT.709."""
WAIT_S: Final = 0.2


@dataclass(frozen=True, eq=False)
class FilmFacts:
    """What a film is: its size as it is shown, when each picture comes (n,), and whether it has
    sound. `start_s` is when the first picture comes by the file's own clock.
    """

    size_px: tuple[int, int]
    stamps_s: Vector
    seconds: float
    has_sound: bool
    start_s: float
    codec: str = ""
    pixel_format: str = ""
    container: str = ""
    location: str = ""
    """Where it was filmed, if its file says so."""

    def index_at(self, t_s: float) -> int:
        """Return which picture is there at a time; before and after it the first and the last."""
        last = len(self.stamps_s) - 1
        return int(np.clip(np.searchsorted(self.stamps_s, t_s + 1e-6, "right") - 1, 0, last))


def facts_of(film: Video | Panorama, folder: Path) -> FilmFacts:
    """Return what the film of a stimulus is, whose file lies in a folder.

    Raises:
        DesignError: as of `film_facts`.
    """
    return film_facts(picture_path(film, folder), is_around=isinstance(film, Panorama))


def film_facts(path: Path, *, is_around: bool = False) -> FilmFacts:
    """Return what a film is, found once for each version of its file; one all around may be larger.

    Raises:
        DesignError: it is missing, too large, no film, cut short, or cannot be decoded here.
    """
    if not path.is_file():
        names = [p.name for p in path.parent.glob("*")] if path.parent.is_dir() else []
        same = [n for n in names if n.casefold() == path.name.casefold()]
        hint = f"; did you mean {same[0]}?" if same else "; put it beside the study's file"
        raise DesignError(f"there is no film {path}{hint}")
    status = path.stat()
    if status.st_size > MAX_FILE_BYTES:
        raise DesignError(
            f"{path}: {status.st_size / 1e6:.0f} MB; a film has {MAX_FILE_BYTES / 1e6:.0f} at "
            f"most. Make it smaller: ffmpeg -i {path.name} -crf 23 smaller.mp4"
        )
    facts = _facts(path, status.st_mtime_ns)
    wide, high = facts.size_px
    most_px, usual_px = (MAX_AROUND_PX, 3840) if is_around else (MAX_SIZE_PX, 1920)
    if max(wide, high) > most_px:
        raise DesignError(
            f"{path}: {wide} × {high} pixels; up to {most_px} each way. Make it "
            f"smaller: ffmpeg -i {path.name} -vf scale={usual_px}:-2 smaller.mp4"
        )
    return facts


@lru_cache(maxsize=512)
def _facts(path: Path, modified_ns: int) -> FilmFacts:
    av = _av(path)
    try:
        with av.open(str(path)) as file:
            return _read_facts(path, file)
    except av.error.FFmpegError as problem:
        why = problem.strerror or problem
        raise DesignError(
            f"{path} is no film that can be read, or cut short ({why}); copy or save it again"
        ) from problem


def _read_facts(path: Path, file: Any) -> FilmFacts:
    if not file.streams.video:
        raise DesignError(f"{path}: there is no picture in it; a sound is shown by Sound")
    stream = file.streams.video[0]
    if stream.codec_context is None:
        raise DesignError(f"{path}: its codec is not there{_as_usual(path)}")
    declared_s = max(
        float(stream.duration * stream.time_base) if stream.duration else 0.0,
        (file.duration or 0) / 1e6 if not file.streams.audio else 0.0,
    )
    ticks, ends = [], []
    for packet in file.demux(stream):
        if packet.pts is not None:
            ticks.append(packet.pts)
            ends.append(packet.pts + (packet.duration or 0))
    if len(ticks) < 2:
        raise DesignError(f"{path} is a picture, not a film; show it by Image")
    stamps_s = np.sort(np.array(ticks, np.float64)) * float(stream.time_base)
    start_s = float(stamps_s[0])
    stamps_s = stamps_s - start_s
    usual_s = float(np.median(np.diff(stamps_s)))
    seconds = max(float(max(ends) * stream.time_base) - start_s, float(stamps_s[-1]) + usual_s)
    if seconds < declared_s - CUT_S - usual_s:
        raise DesignError(
            f"{path}: cut short, {seconds:.2f} s of {declared_s:.2f} s; copy or save it again"
        )
    file.seek(0)
    frame = next(file.decode(stream), None)
    if frame is None:
        raise DesignError(f"{path}: no picture of it can be decoded{_as_usual(path)}")
    if getattr(frame, "rotation", 0) % 360:
        raise DesignError(
            f"{path}: its camera was held {frame.rotation % 360}° turned, which players correct; "
            f"write it upright: ffmpeg -i {path.name} upright.mp4"
        )
    aspect = stream.sample_aspect_ratio or 1
    size_px = (round(frame.width * aspect), frame.height)
    return FilmFacts(
        size_px,
        stamps_s,
        seconds,
        bool(file.streams.audio),
        start_s,
        stream.codec_context.name,
        str(stream.codec_context.pix_fmt),
        file.format.name,
        _location_in(file),
    )


def _location_in(file: Any) -> str:
    metadata = (file.metadata, *(stream.metadata for stream in file.streams))
    places = (v for of in metadata for name, v in of.items() if "location" in name.lower())
    return str(next(places, ""))


BROWSERS_PLAY: Final = {
    "mp4": ("video/mp4", ("h264", "libdav1d", "av1")),
    "webm": ("video/webm", ("vp8", "libvpx", "vp9", "libvpx-vp9", "libdav1d", "av1")),
}
"""The kinds of file that browsers play: their names, and codecs within by FFmpeg's names."""


def kind_for_browsers(path: Path) -> str:
    """Return the kind of a film, as browsers call it.

    Raises:
        DesignError: few browsers play it, or it says where it was filmed, which whoever opens the
            page could read.
    """
    facts = film_facts(path)
    if facts.location:
        raise DesignError(
            f"{path} says where it was filmed ({facts.location[:40]}), and pages give it away as "
            f"it is; write it without: ffmpeg -i {path.name} -map_metadata -1 -c copy "
            f"plain{path.suffix}"
        )
    for container, (kind, codecs) in BROWSERS_PLAY.items():
        is_plain = facts.pixel_format in ("yuv420p", "yuvj420p")
        if container in facts.container.split(",") and facts.codec in codecs and is_plain:
            return kind
    raise DesignError(
        f"{path}: few browsers play such a film ({facts.container}, {facts.codec}, "
        f"{facts.pixel_format}){_as_usual(path)}"
    )


def _as_usual(path: Path) -> str:
    usual = "-c:v libx264 -pix_fmt yuv420p usual.mp4"
    return f"; write it in a usual one: ffmpeg -i {path.name} {usual}"


def _av(path: Path) -> Any:
    try:
        import av  # of the extra "browser"
    except ImportError as problem:
        raise DesignError(
            f"{path}: films need PyAV, which is not installed; run: pip install 'visavis[browser]'"
        ) from problem
    return av


@dataclass
class _Decoding(Generic[Content]):
    """What a thread that decodes shares with its reader; it holds no reader, so that both end."""

    pictures: "queue.Queue[tuple[int, Content | Exception]]"
    wanted_index: int
    is_over: threading.Event


class PictureReader(Generic[Content]):
    """Own the decoding of one film into pictures of one size, and what `make` makes of them, ahead
    of their time in a thread.
    """

    def __init__(
        self,
        path: Path,
        size_px: tuple[int, int],
        make: Callable[[Pixels], Content],
        *,
        is_around: bool = False,
    ) -> None:
        self.facts = film_facts(path, is_around=is_around)
        self._path, self._size_px, self._make = path, size_px, make
        ahead = AHEAD_BYTES // (4 * size_px[0] * size_px[1])
        self._ahead = int(np.clip(ahead, MIN_AHEAD, MAX_AHEAD))
        self._decoding: _Decoding[Content] | None = None
        self._shown_picture: tuple[int, Content] | None = None
        self._first: Content | None = None

    def picture_at(self, t_s: float) -> Content:
        """Return what is made of the picture of a time, the same object for the same picture; wait
        for it where it is not decoded yet.

        Raises:
            DesignError: it cannot be decoded.
        """
        wanted_index = self.facts.index_at(t_s)
        if self._shown_picture is not None and self._shown_picture[0] == wanted_index:
            return self._shown_picture[1]
        if wanted_index == 0 and self._first is not None:
            self._begin(0)
        elif self._decoding is None or (
            self._shown_picture is not None and self._shown_picture[0] > wanted_index
        ):
            self._begin(wanted_index)
        assert self._decoding is not None  # noqa: S101 - it was begun
        self._decoding.wanted_index = wanted_index
        while self._shown_picture is None or self._shown_picture[0] < wanted_index:
            index, pixels = self._decoding.pictures.get()
            if isinstance(pixels, Exception):
                self._decoding = None
                raise DesignError(
                    f"{self._path}: damaged at {self.facts.stamps_s[wanted_index]:.2f} s "
                    f"({pixels}); copy or save it again"
                ) from pixels
            self._shown_picture = index, pixels
        if wanted_index == 0:
            self._first = self._shown_picture[1]
        return self._shown_picture[1]

    def _begin(self, first: int) -> None:
        if self._decoding is not None:
            self._decoding.is_over.set()
        decoding: _Decoding[Content] = _Decoding(queue.Queue(self._ahead), first, threading.Event())
        self._decoding = decoding
        self._shown_picture = None if first or self._first is None else (0, self._first)
        weakref.finalize(self, decoding.is_over.set)
        arguments = (self._path, self._size_px, self._make, self.facts, first, decoding)
        threading.Thread(target=_decode, args=arguments, name="film", daemon=True).start()


class FilmReader(PictureReader[Pixels]):
    """Own the decoding of one film into pictures of one size (h, w, 4)."""

    def __init__(self, path: Path, size_px: tuple[int, int]) -> None:
        super().__init__(path, size_px, _as_it_is)


def _as_it_is(pixels: Pixels) -> Pixels:
    return pixels


def _decode(
    path: Path,
    size_px: tuple[int, int],
    make: Callable[[Pixels], Content],
    facts: FilmFacts,
    first: int,
    decoding: _Decoding[Content],
) -> None:
    """Decode pictures from one on, until the film or its reader is over."""
    last: tuple[int, Content | Exception] = (first, DesignError("it has no such picture"))
    try:
        for index, frame in _frames_from(path, facts, first):
            if index < decoding.wanted_index and index != len(facts.stamps_s) - 1:
                continue  # nobody needs it any more
            last = index, make(_rgba(frame, size_px))
            if not _put(decoding, last):
                return
    except Exception as problem:
        _put(decoding, (first, problem))
        return
    _put(decoding, (len(facts.stamps_s) - 1, last[1]))  # a file that promises one picture too many


def _put(decoding: _Decoding[Content], picture: tuple[int, Content | Exception]) -> bool:
    """Hand a picture over, as soon as there is room; False where nobody waits any more."""
    while not decoding.is_over.is_set():
        try:
            decoding.pictures.put(picture, timeout=WAIT_S)
        except queue.Full:
            continue
        return True
    return False


def _frames_from(path: Path, facts: FilmFacts, first: int) -> Iterator[tuple[int, Any]]:
    """Yield pictures with their numbers, from one on."""
    with _av(path).open(str(path)) as file:
        stream = file.streams.video[0]
        stream.thread_type = "AUTO"
        if first:
            at_s = float(facts.stamps_s[first]) + facts.start_s
            file.seek(int(at_s / stream.time_base), stream=stream)
        for frame in file.decode(stream):
            if frame.time is None:
                continue
            index = facts.index_at(frame.time - facts.start_s + 1e-4)
            if index >= first:
                yield index, frame


def _rgba(frame: Any, size_px: tuple[int, int]) -> Pixels:
    """Return a frame as sRGB bytes with opacity in its size on the display."""
    from av.video.reformatter import Colorspace

    is_high = frame.height >= HIGH_DEFINITION_PX
    assumed_space = Colorspace.ITU709 if is_high else Colorspace.ITU601
    space = {1: Colorspace.ITU709, 5: Colorspace.ITU601, 6: Colorspace.ITU601}.get(
        int(frame.colorspace), assumed_space
    )
    wide, high = size_px
    picture = frame.reformat(width=wide, height=high, format="rgba", src_colorspace=space)
    return np.ascontiguousarray(picture.to_ndarray())

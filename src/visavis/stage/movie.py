"""Write films: Motion-JPEG in AVI by ourselves, other formats through the ffmpeg program."""

import io
import shutil
import struct
import subprocess  # a fixed program with arguments of ours
from pathlib import Path
from typing import IO, Final, Protocol

import numpy as np
import numpy.typing as npt
from PIL import Image

from visavis.lab.clock import NS_PER_S
from visavis.lab.closing import Closing
from visavis.stage.errors import StageError

JPEG_QUALITY: Final = 92
HAS_INDEX: Final = 0x10
KEY_FRAME: Final = 0x10
Picture = npt.NDArray[np.uint8]

COLOURS: Final = (
    "-vf scale=out_color_matrix=bt709:out_range=tv:flags=bicubic+accurate_rnd+full_chroma_int "
    "-colorspace bt709 -color_primaries bt709 -color_trc iec61966-2-1 -color_range tv "
    "-pix_fmt yuv420p"
).split()
"""sRGB, told to the player; the halved colour resolution is all that every player can show."""
CODECS: Final = {
    ".mp4": ("-c:v", "libx264", "-preset", "veryfast", "-crf", "17", "-movflags", "+faststart"),
    ".webm": ("-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1", "-cpu-used", "3"),
}


class Movie(Protocol):
    """A film being written; frames (h, w, 3) sRGB bytes of one size, in order."""

    def add(self, frame: Picture) -> None:
        """Append a frame."""
        ...

    def close(self) -> None:
        """Finish the file; idempotent."""
        ...


def picture_times_ns(start_ns: int, end_ns: int, rate_hz: int) -> list[int]:
    """Return the times of the pictures of a film from its start up to before its end.

    Six seconds at one a second are six pictures. A film has at least one.
    """
    count = max(1, -(-(end_ns - start_ns) * rate_hz // NS_PER_S))
    return [start_ns + k * NS_PER_S // rate_hz for k in range(count)]


def open_movie(path: Path, size_px: tuple[int, int], rate_hz: int) -> "WholeMovie":
    """Begin a film of (width, height) at so many frames a second; never replaces a file.

    It is written beside its name and moved there when it is whole; what fails leaves no file.
    `.avi` needs nothing and is twenty times as large; `.mp4` and `.webm` need the ffmpeg program.

    Raises:
        StageError: the file exists, the ending is unknown, or ffmpeg is not installed.
    """
    if path.exists():
        raise StageError(f"{path} exists already", remedy="choose another name")
    program = film_program(path)
    unfinished_path = path.with_name(f".{path.stem}.unfinished{path.suffix}")
    if program is None:
        return WholeMovie(MotionJpeg(unfinished_path, size_px, rate_hz), unfinished_path, path)
    return WholeMovie(
        PipedMovie(program, unfinished_path, size_px, rate_hz, path), unfinished_path, path
    )


def film_program(path: Path) -> str | None:
    """Return the program that writes films of this name, None where none is needed.

    Raises:
        StageError: the ending is unknown, or the program is not installed.
    """
    ending = path.suffix.lower()
    if ending == ".avi":
        return None
    if ending not in CODECS:
        raise StageError(
            f"{path}: no film of the kind {ending or 'without ending'!r} can be written",
            remedy="name it .avi, .mp4 or .webm",
        )
    program = _ffmpeg()
    if program is None:
        raise StageError(
            f"{path}: writing {ending} needs the program ffmpeg, which is not installed",
            remedy="run: pip install 'visavis[films]' (or install ffmpeg), or name the film .avi",
        )
    return program


def _ffmpeg() -> str | None:
    """Return the program installed with the extra `films`, or else the system's."""
    try:
        import imageio_ffmpeg
    except ImportError:
        return shutil.which("ffmpeg")
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError:  # a package without its program
        return shutil.which("ffmpeg")


class WholeMovie(Closing):
    """A film that gets its name only when complete; an abandoned one is removed."""

    def __init__(self, writes: Movie, unfinished_path: Path, path: Path) -> None:
        self._writes, self._unfinished_path, self._path = writes, unfinished_path, path

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        """Finish the file, or remove it after an error."""
        if kind is None:
            self.close()
            return
        try:
            self._writes.close()
        except StageError:  # of an abandoned film; the first error is raised
            pass
        finally:
            self._unfinished_path.unlink(missing_ok=True)

    def add(self, frame: Picture) -> None:
        """Append a frame; see the writers for what it raises."""
        self._writes.add(frame)

    def close(self) -> None:
        """Finish the file and give it its name; idempotent.

        Raises:
            StageError: it could not be written, or another has its name by now.
        """
        try:
            self._writes.close()
            if self._unfinished_path.exists():
                if self._path.exists():
                    raise StageError(f"{self._path} exists already", remedy="choose another name")
                self._unfinished_path.rename(self._path)
        finally:
            self._unfinished_path.unlink(missing_ok=True)


class MotionJpeg:
    """Every frame a JPEG in an AVI container (RIFF), with an index; plays nearly everywhere."""

    def __init__(self, path: Path, size_px: tuple[int, int], rate_hz: int) -> None:
        self._size_px, self._rate_hz = size_px, rate_hz
        self._index: list[tuple[int, int]] = []
        self._largest = 0
        self._file: IO[bytes] | None = path.open("wb")
        self._file.write(self._header())
        self._movi_at = self._file.tell() - 4

    def add(self, frame: Picture) -> None:
        """Append a frame.

        Raises:
            StageError: it is of another size, or the film is closed.
        """
        width, height = self._size_px
        if self._file is None or frame.shape != (height, width, 3):
            raise StageError(
                f"a film of {width} × {height} pixels was given a frame of shape {frame.shape}",
                remedy="draw every frame in the size the film was opened with",
            )
        buffer = io.BytesIO()
        Image.fromarray(frame).save(buffer, "JPEG", quality=JPEG_QUALITY, subsampling=0)
        data = buffer.getvalue()
        self._index.append((self._file.tell() - self._movi_at, len(data)))
        self._largest = max(self._largest, len(data))
        self._file.write(_chunk(b"00dc", data))

    def close(self) -> None:
        """Write index and lengths; idempotent."""
        if self._file is None:
            return
        file, self._file = self._file, None
        with file:
            movi_end = file.tell()
            rows = b"".join(
                struct.pack("<4sIII", b"00dc", KEY_FRAME, at, length) for at, length in self._index
            )
            file.write(_chunk(b"idx1", rows))
            end = file.tell()
            file.seek(0)
            file.write(self._header())
            file.seek(self._movi_at - 4)
            file.write(struct.pack("<I", movi_end - self._movi_at))
            file.seek(4)
            file.write(struct.pack("<I", end - 8))

    def _header(self) -> bytes:
        (width, height), rate, n = self._size_px, self._rate_hz, len(self._index)
        main = struct.pack(
            "<14I", round(1e6 / rate), self._largest * rate, 0, HAS_INDEX, n, 0, 1,
            self._largest + 8, width, height, 0, 0, 0, 0,
        )  # fmt: skip
        stream = struct.pack(
            "<4s4sIHHIIIIIIII4H", b"vids", b"MJPG", 0, 0, 0, 0, 1, rate, 0, n,
            self._largest + 8, 0xFFFFFFFF, 0, 0, 0, width, height,
        )  # fmt: skip
        picture = struct.pack(
            "<IiiHH4sIiiII", 40, width, height, 1, 24, b"MJPG", width * height * 3, 0, 0, 0, 0
        )
        one = _list(b"strl", _chunk(b"strh", stream) + _chunk(b"strf", picture))
        head = _list(b"hdrl", _chunk(b"avih", main) + one)
        return b"RIFF" + struct.pack("<I", 0) + b"AVI " + head + b"LIST" + b"\0\0\0\0" + b"movi"


def _chunk(name: bytes, data: bytes) -> bytes:
    return name + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


def _list(name: bytes, data: bytes) -> bytes:
    return b"LIST" + struct.pack("<I", len(data) + 4) + name + data


class PipedMovie:
    """Frames handed to the ffmpeg program, which encodes by the file's ending."""

    def __init__(
        self, program: str, path: Path, size_px: tuple[int, int], rate_hz: int, final_path: Path
    ) -> None:
        width, height = size_px
        self._path, self._size_px = final_path, size_px
        codec = CODECS[path.suffix.lower()]
        options = (
            f"-loglevel error -y -f rawvideo -pix_fmt rgb24 -s {width}x{height} -r {rate_hz} -i -"
        )
        self._process: subprocess.Popen[bytes] | None = subprocess.Popen(  # noqa: S603  (a fixed program; the path is one argument)
            [program, *options.split(), *COLOURS, *codec, str(path)],
            stdin=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def add(self, frame: Picture) -> None:
        """Append a frame.

        Raises:
            StageError: ffmpeg has stopped.
        """
        if self._process is None or self._process.stdin is None:
            raise StageError(f"{self._path}: the film is closed", remedy="open another one")
        try:
            self._process.stdin.write(np.ascontiguousarray(frame).tobytes())
        except BrokenPipeError as problem:
            raise self._failure() from problem

    def close(self) -> None:
        """Wait for the last frame to be written; idempotent.

        Raises:
            StageError: ffmpeg could not write the film.
        """
        if self._process is None:
            return
        process = self._process
        _, message = process.communicate()
        self._process = None
        if process.returncode != 0:
            raise StageError(
                f"{self._path}: ffmpeg failed: {message.decode(errors='replace').strip()}",
                remedy="name the film .avi",
            )

    def _failure(self) -> StageError:
        process = self._process
        message = process.communicate()[1] if process is not None else b""
        self._process = None
        return StageError(
            f"{self._path}: ffmpeg stopped: {message.decode(errors='replace').strip()}",
            remedy="name the film .avi",
        )

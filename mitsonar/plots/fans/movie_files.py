"""Files that frames go into one after another, so that memory does not grow with their number.

A folder gets a PNG a frame, a GIF frames of one palette, an MP4 (H.264) what ``ffmpeg`` makes of raw frames: that of
the package ``imageio-ffmpeg`` where it is installed, else the system's.
"""
import contextlib
import os
import shutil
import subprocess
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast, final

import numpy as np
from matplotlib.colors import Colormap, to_rgb
from PIL import GifImagePlugin, Image

from mitsonar.device.files import FilePath, check_writable, replacing

from .. import canvas

KINDS = (".gif", ".mp4")           # and a folder, whose name has no suffix
SHADES = 224                       # of a GIF's 256 colours: those of the picture; the rest are the frame's
FASTEST_GIF = 50                   # frames a second: viewers slow down what is faster
QUALITY = "20"                     # of H.264, as its constant rate factor: noise is hard to compress


class MovieFile(ABC):
    """What takes frames."""

    @abstractmethod
    def add(self, pixels: np.ndarray) -> None:
        """Take the next frame: colours (rows, columns, 3) uint8, of the same size as the first."""


@contextlib.contextmanager
def movie_file(path: FilePath, fps: float, colours: Colormap) -> Iterator[MovieFile]:
    """Open a file for frames; it is there once all are in it, or not at all."""
    # fps [Hz]
    kind = check_movie(path)
    if kind == "":
        with _folder(path) as folder:
            yield _Pictures(folder)
        return
    if kind == ".gif" and fps > FASTEST_GIF:
        raise ValueError(f"{fps:g} frames a second are more than the {FASTEST_GIF} that viewers of GIF files show; "
                         "give fewer, or write an MP4.")
    with replacing(path) as temporary:
        if kind == ".gif":
            with open(temporary, "wb") as file:
                gif = _Gif(file, fps, colours)
                yield gif
                gif.end()
            return
        with _Mp4(_ffmpeg(path), temporary, fps) as movie:
            yield movie


def check_movie(path: FilePath) -> str:
    """Check that frames can be written to a path, before any work is spent on them."""
    target = Path(os.path.abspath(path))
    kind = target.suffix.lower()
    if kind not in ("", *KINDS):
        raise ValueError(f"cannot write the video {path}: its name must end in {' or '.join(KINDS)}, or be that of a "
                         "folder for PNG files, without a suffix.")
    if kind == "":
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            what = "a folder with files" if target.is_dir() else "a file"
            raise ValueError(f"cannot write frames to {path}: it is {what}; give another name.")
        check_writable(target.parent / "frame.png")
        return kind
    check_writable(path)
    if kind == ".mp4":
        _ffmpeg(path)
    return kind


@contextlib.contextmanager
def _folder(path: FilePath) -> Iterator[Path]:
    """A folder that takes its name once it is complete."""
    target = Path(os.path.abspath(path))
    temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        yield temporary
        temporary.chmod(0o777 & ~_mask())
        if target.exists():
            target.rmdir()
        temporary.replace(target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _mask() -> int:
    """The mode that the process takes away from new files."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


@final
class _Pictures(MovieFile):
    """frame_00000.png, frame_00001.png, ..."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0

    def add(self, pixels: np.ndarray) -> None:
        Image.fromarray(pixels).save(self._folder / f"frame_{self._count:05d}.png")
        self._count += 1


@final
class _Gif(MovieFile):
    """Pillow's own writer of animations keeps every frame in memory, so its parts are written here one by one."""

    def __init__(self, file: IO[bytes], fps: float, colours: Colormap) -> None:
        self._file, self._fps, self._count = file, fps, 0
        self._palette = Image.new("P", (1, 1))
        self._palette.putpalette(_palette(colours))

    def add(self, pixels: np.ndarray) -> None:
        frame = Image.fromarray(pixels).quantize(palette=self._palette, dither=Image.Dither.NONE)
        if self._count == 0:
            self._write(GifImagePlugin.getheader(frame, info={"loop": 0})[0])
        # in hundredths of a second; what rounding takes from one frame the next one gets
        ends = [round(100 * number / self._fps) for number in (self._count, self._count + 1)]
        self._write(GifImagePlugin.getdata(frame, duration=10 * (ends[1] - ends[0])))
        self._count += 1

    def end(self) -> None:
        """Write what ends the file."""
        self._write([b";"])

    def _write(self, parts: list[bytes]) -> None:
        for part in parts:
            self._file.write(part)


def _palette(colours: Colormap) -> list[int]:
    """The picture's colours, and those between the sheet and what is written on it."""
    shades = colours(np.linspace(0, 1, SHADES))[:, :3]
    share = np.linspace(0, 1, 256 - SHADES)[:, None]
    frame = (1 - share) * to_rgb(canvas.PAPER) + share * np.array(to_rgb(canvas.INK))
    return np.rint(255 * np.concatenate([shades, frame])).astype(int).ravel().tolist()


@final
class _Mp4(MovieFile):
    """A pipe to ffmpeg, which is started when the first frame says how large frames are."""

    def __init__(self, program: str, path: Path, fps: float) -> None:
        self._program, self._path, self._fps = program, path, fps
        self._running: subprocess.Popen[bytes] | None = None
        self._said = tempfile.TemporaryFile()

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        running = self._running
        if running is not None:
            with contextlib.suppress(BrokenPipeError):
                cast(IO[bytes], running.stdin).close()
            if kind is not None:
                running.kill()
            if running.wait() and kind is None:
                raise self._failure()
        self._said.close()

    def add(self, pixels: np.ndarray) -> None:
        even = np.pad(pixels, [(0, pixels.shape[0] % 2), (0, pixels.shape[1] % 2), (0, 0)], mode="edge")
        if self._running is None:
            size = f"{even.shape[1]}x{even.shape[0]}"
            self._running = subprocess.Popen(
                [self._program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size,
                 "-r", f"{self._fps:.6g}", "-i", "-", "-c:v", "libx264", "-crf", QUALITY, "-pix_fmt", "yuv420p",
                 "-f", "mp4", str(self._path)], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=self._said)
        try:
            cast(IO[bytes], self._running.stdin).write(np.ascontiguousarray(even).data)
        except BrokenPipeError:
            raise self._failure() from None

    def _failure(self) -> OSError:
        """What ffmpeg said last, as an error."""
        self._said.seek(0)
        said = self._said.read().decode("utf-8", "replace").strip().splitlines()
        return OSError(f"ffmpeg could not write the video: {said[-1] if said else 'it ended'}; write a GIF or a folder "
                       "of PNG files.")


def _ffmpeg(path: FilePath) -> str:
    """The program's path, of the package or of the system."""
    with contextlib.suppress(ImportError, RuntimeError):
        from imageio_ffmpeg import get_ffmpeg_exe  # pyright: ignore[reportMissingImports]  # an optional package

        return get_ffmpeg_exe()
    program = shutil.which("ffmpeg")
    if program is None:
        raise ValueError(f"cannot write {path}: MP4 files need the program ffmpeg; run pip install imageio-ffmpeg, or "
                         "give a name that ends in .gif, or a folder for PNG files.")
    return program

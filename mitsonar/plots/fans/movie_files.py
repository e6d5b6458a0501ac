"""Files that frames go into one after another, so that memory does not grow with their number.

A folder gets a PNG a frame, a GIF frames of one palette by Pillow, an MP4 (H.264) what imageio makes of the frames: of
the extra ``video``.
"""
import contextlib
import os
import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, final

import numpy as np
from matplotlib.colors import Colormap, to_rgb
from PIL import GifImagePlugin, Image

from mitsonar.device.files import FilePath, check_writable, replacing

from .. import canvas

KINDS = (".gif", ".mp4")           # and a folder, whose name has no suffix
SHADES = 224                       # of a GIF's 256 colours: those of the picture; the rest are the frame's
FASTEST_GIF = 50                   # frames a second: viewers slow down what is faster
QUALITY = "20"                     # of H.264, as its constant rate factor: noise is hard to compress
_FAILED = "ffmpeg could not write the video, for the reason that it printed; write a GIF or a folder of PNG files."


class MovieFile(ABC):
    """A writer of frames."""

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
            yield _MoviePictures(folder)
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
        with _mp4(path, temporary, fps) as movie:
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
        _video_packages(path)
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
class _MoviePictures(MovieFile):
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
    """H.264 by imageio, whose frames have even sides."""

    def __init__(self, writer: Any) -> None:
        self._writer, self.count = writer, 0

    def add(self, pixels: np.ndarray) -> None:
        even = np.pad(pixels, [(0, pixels.shape[0] % 2), (0, pixels.shape[1] % 2), (0, 0)], mode="edge")
        self._writer.append_data(even)
        self.count += 1


@contextlib.contextmanager
def _mp4(path: FilePath, temporary: Path, fps: float) -> Iterator[_Mp4]:
    """Open an MP4, and count its frames when all are in: imageio does not ask ffmpeg how it ended."""
    imageio, imageio_ffmpeg = _video_packages(path)
    writer = imageio.get_writer(str(temporary), format="FFMPEG", mode="I", fps=fps, codec="libx264", quality=None,
                                macro_block_size=1, ffmpeg_log_level="error",
                                output_params=["-crf", QUALITY, "-f", "mp4"])
    with writer:
        movie = _Mp4(writer)
        try:
            yield movie
        except OSError as error:
            if "FFMPEG COMMAND" not in str(error):
                raise
            raise OSError(_FAILED) from None
    try:
        written = movie.count and imageio_ffmpeg.count_frames_and_secs(str(temporary))[0]
    except (OSError, RuntimeError):
        written = -1
    if written != movie.count:
        raise OSError(_FAILED)


def _video_packages(path: FilePath) -> tuple[Any, Any]:
    """Return imageio and imageio_ffmpeg, which has found a program ffmpeg."""
    try:
        import imageio.v2 as imageio  # pyright: ignore[reportMissingImports]  # of the extra video
        import imageio_ffmpeg  # pyright: ignore[reportMissingImports]  # of the extra video

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise ValueError(f"cannot write {path}: MP4 files need the extra video; run pip install 'mitsonar[video]', or "
                         "give a name that ends in .gif, or a folder for PNG files.") from None
    return imageio, imageio_ffmpeg

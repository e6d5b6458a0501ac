"""Files of videos, to which frames are added one after another, so that memory does not grow with their number.

A folder gets one PNG per frame. GIF files are made by Pillow with one palette, and MP4 files (H.264) by imageio, which
comes with the extra ``video``.
"""
import contextlib
import itertools
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from matplotlib.colors import Colormap, to_rgb
from PIL import GifImagePlugin, Image

from mitsonar.device.extras import MissingExtra
from mitsonar.device.files import FilePath, check_writable, checked_suffix, replacing

from .. import canvas

AddFrame = Callable[[np.ndarray], None]        # takes colours (rows, columns, 3) uint8, of one size for all frames
KINDS = (".gif", ".mp4")           # a name without a suffix is a folder
SHADES = 224                       # colours of the image among a GIF's 256; the rest are those of the sheet around it
FASTEST_GIF = 50                   # frames per second; viewers slow down faster files
QUALITY = "20"                     # constant rate factor of H.264; noise is hard to compress
_FAILED = "ffmpeg could not write the video, for the reason that it printed; write a GIF or a folder of PNG files."


@contextlib.contextmanager
def movie_file(path: FilePath, fps: float, colours: Colormap, width: int | None = None) -> Iterator[AddFrame]:
    """Open a video file, and yield a function that adds frames; the file appears only when all are written.

    Frames of more than `width` columns are reduced to it.
    """
    with _opened(path, fps, colours) as add:
        yield add if width is None else lambda pixels: add(_narrowed(pixels, width))


def _narrowed(pixels: np.ndarray, width: int) -> np.ndarray:
    """Return a frame with at most a number of columns."""
    rows, columns = pixels.shape[:2]
    if columns <= width:
        return pixels
    size = width, max(1, round(rows * width / columns))
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS))


@contextlib.contextmanager
def _opened(path: FilePath, fps: float, colours: Colormap) -> Iterator[AddFrame]:
    """Open a video file for frames as they are."""
    kind = check_movie(path)
    if kind == "":
        with _folder(path) as folder:
            numbers = itertools.count()
            yield lambda pixels: Image.fromarray(pixels).save(folder / f"frame_{next(numbers):05d}.png")
        return
    if kind == ".gif" and fps > FASTEST_GIF:
        raise ValueError(f"{fps:g} frames a second are more than the {FASTEST_GIF} that viewers of GIF files show; "
                         "give fewer, or write an MP4.")
    with replacing(path) as temporary:
        if kind == ".gif":
            with open(temporary, "wb") as file:
                yield _gif_writer(file, fps, colours)
                file.write(b";")                       # end of a GIF
            return
        with _mp4(path, temporary, fps) as add:
            yield add


def check_movie(path: FilePath) -> str:
    """Check that frames can be written to a path, before any work is spent on them, and return its suffix."""
    target = Path(os.path.abspath(path))
    kind = target.suffix.lower()
    if kind == "":
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            obstacle = "a folder with files" if target.is_dir() else "a file"
            raise ValueError(f"cannot write frames to {path}: it is {obstacle}; give another name.")
        check_writable(target.parent / "frame.png")
        return kind
    checked_suffix(path, KINDS, ", or be that of a folder for PNG files, without a suffix", what="the video")
    check_writable(path)
    if kind == ".mp4":
        _video_packages(path)
    return kind


@contextlib.contextmanager
def _folder(path: FilePath) -> Iterator[Path]:
    """Yield a temporary folder, which is renamed once it is complete."""
    target = Path(os.path.abspath(path))
    temporary = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        yield temporary
        mask = os.umask(0)                             # a process can read its mask only by setting it
        os.umask(mask)
        temporary.chmod(0o777 & ~mask)
        if target.exists():
            target.rmdir()
        temporary.replace(target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _gif_writer(file: IO[bytes], fps: float, colours: Colormap) -> AddFrame:
    """Return a function that writes the parts of a GIF; Pillow's own writer would keep every frame in memory."""
    palette, numbers = Image.new("P", (1, 1)), itertools.count()
    palette.putpalette(_palette(colours))

    def add(pixels: np.ndarray) -> None:
        frame, number = Image.fromarray(pixels).quantize(palette=palette, dither=Image.Dither.NONE), next(numbers)
        if number == 0:
            file.writelines(GifImagePlugin.getheader(frame, info={"loop": 0})[0])
        # end times in hundredths of a second; the next frame makes up for the rounding of this one
        start, end = (round(100 * edge / fps) for edge in (number, number + 1))
        file.writelines(GifImagePlugin.getdata(frame, duration=10 * (end - start)))

    return add


def _palette(colours: Colormap) -> list[int]:
    """Return the colours of the image, then those between the paper and the ink of the sheet."""
    shades = colours(np.linspace(0, 1, SHADES))[:, :3]
    share = np.linspace(0, 1, 256 - SHADES)[:, None]
    frame = (1 - share) * to_rgb(canvas.PAPER) + share * np.array(to_rgb(canvas.INK))
    return np.rint(255 * np.concatenate([shades, frame])).astype(int).ravel().tolist()


@contextlib.contextmanager
def _mp4(path: FilePath, temporary: Path, fps: float) -> Iterator[AddFrame]:
    """Open an MP4, and count its frames at the end, because imageio does not check ffmpeg's exit status."""
    imageio, imageio_ffmpeg = _video_packages(path)
    writer = imageio.get_writer(str(temporary), format="FFMPEG", mode="I", fps=fps, codec="libx264", quality=None,
                                macro_block_size=1, ffmpeg_log_level="error",
                                output_params=["-crf", QUALITY, "-f", "mp4"])
    count = 0

    def add(pixels: np.ndarray) -> None:
        nonlocal count
        # H.264 needs even numbers of rows and columns
        even = np.pad(pixels, [(0, pixels.shape[0] % 2), (0, pixels.shape[1] % 2), (0, 0)], mode="edge")
        writer.append_data(even)
        count += 1

    with writer:
        try:
            yield add
        except OSError as error:
            if "FFMPEG COMMAND" not in str(error):
                raise
            raise OSError(_FAILED) from None
    try:
        written = count and imageio_ffmpeg.count_frames_and_secs(str(temporary))[0]
    except (OSError, RuntimeError):
        written = -1
    if written != count:
        raise OSError(_FAILED)


def _video_packages(path: FilePath) -> tuple[Any, Any]:
    """Return imageio and imageio_ffmpeg; raise ValueError without them or without a program ffmpeg."""
    try:
        import imageio.v2 as imageio  # pyright: ignore[reportMissingImports]  # of the extra video
        import imageio_ffmpeg  # pyright: ignore[reportMissingImports]  # of the extra video

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise MissingExtra(f"cannot write {path}: MP4 files need the extra video", "video",
                           "give a name that ends in .gif, or a folder for PNG files") from None
    return imageio, imageio_ffmpeg

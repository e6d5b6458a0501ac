"""Checks of pictures and volumes for textures by their headers, before Mitsuba allocates memory for them.

A picture of a few kilobytes may claim more pixels than any memory holds: Mitsuba's readers do not check this, and two
of them (Targa and Radiance) write beyond their memory if the content does not agree.
"""
import os
import struct
import warnings

from mitsonar.device import files
from mitsonar.device.files import FilePath

MOST_PIXELS = 100_000_000          # 10000 x 10000
MOST_BYTES = 2_000_000_000         # unpacked
REMEDY = "give a PNG, JPEG or OpenEXR file"


def check(path: FilePath) -> None:
    """Check that Mitsuba can read a picture and that it is not too large for a texture."""
    files.check_readable(path, "the picture", "a picture")
    with open(path, "rb") as file:
        start = file.read(8)
    read = next((read for begins, read in READERS if start.startswith(begins)), None)
    if read is None:
        raise ValueError(f"the picture {path} is cut short, or no picture that can be read; {REMEDY}")
    try:
        width, height, channels, depth = read(path)
    except ValueError as error:
        raise ValueError(f"the picture {path} cannot be read: {error}; {REMEDY}") from None
    if not (0 < width and 0 < height and 0 < channels):
        raise ValueError(f"the picture {path} has {width} x {height} pixels of {channels} channels; {REMEDY}")
    if width * height > MOST_PIXELS or width * height * channels * depth > MOST_BYTES:
        raise ValueError(f"the picture {path} has {width} x {height} pixels of {channels} "
                         f"{'channel' if channels == 1 else 'channels'}, and a texture may have {MOST_PIXELS:,} and "
                         f"{MOST_BYTES:,} bytes; make it coarser, or cut it")


def check_volume(path: FilePath) -> None:
    """Refuse a grid volume (``.vol``) that is shorter than its header states."""
    files.check_readable(path, "the volume", "a grid volume")
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        header = file.read(48)
    if len(header) < 48 or header[:4] != b"VOL\3":
        raise ValueError(f"the volume {path} is cut short, or no grid volume of version 3")
    kind, *shape = struct.unpack("<5i", header[4:24])
    wanted = 48 + 4 * shape[0] * shape[1] * shape[2] * shape[3]
    if kind != 1 or min(shape) < 1 or wanted != size:
        raise ValueError(f"the volume {path} claims {' x '.join(map(str, shape))} numbers of type {kind}, and has "
                         f"{size} bytes; write it again as float32")


def _by_pillow(kind):
    def read(path):
        from PIL import Image, UnidentifiedImageError

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with Image.open(path, formats=[kind]) as image:
                    bands = 4 if image.mode == "P" else len(image.getbands())
                    return *image.size, bands, 4 if image.mode[0] in "IF" else 1
        except Image.DecompressionBombError as error:
            raise ValueError(str(error).partition(",")[0]) from None
        except UnidentifiedImageError:
            raise ValueError("its header is damaged") from None
        except Exception as error:                     # its type depends on where the damage is
            raise ValueError(f"it is damaged ({_shown(error)})") from None
    return read


def _plain(path):
    """Check PPM and PFM: words, one blank, and the numbers."""
    with open(path, "rb") as file:
        words = file.read(400).split(maxsplit=4)[:4]
    if len(words) < 4 or not all(word.isdigit() for word in words[1:3]) or (words[0] == b"P6") != words[3].isdigit():
        raise ValueError("its header is damaged")
    width, height = (int(word[:20]) for word in words[1:3])
    channels, depth = (1 if words[0] == b"Pf" else 3), (4 if words[0] != b"P6" else 1 + (int(words[3][:20]) > 255))
    if width * height * channels * depth > os.path.getsize(path):
        raise ValueError(f"it claims {width} x {height} pixels, and has {os.path.getsize(path)} bytes")
    return width, height, channels, depth


def _bmp(path):
    with open(path, "rb") as file:
        header = file.read(34)
    if len(header) < 34:
        raise ValueError("it is cut short")
    offset, size, width, height, planes, bits, packed = struct.unpack("<IIiiHHI", header[10:])
    if size != 40 or planes != 1 or packed or bits not in (8, 16, 24, 32) or offset < 54:
        raise ValueError("it is no BMP file of a kind that Mitsuba reads")
    width, height, channels = width, abs(height), bits // 8
    if (width * channels + -width * channels % 4) * height + offset > os.path.getsize(path):
        raise ValueError(f"it claims {width} x {height} pixels, and has {os.path.getsize(path)} bytes")
    return width, height, channels, 1


def _exr(path):
    from ..records import exr

    header = exr.header(path)
    (west, north), (east, south) = (tuple(int(value) for value in corner) for corner in header["dataWindow"])
    channels = header["channels"]
    if any((channel.xSampling, channel.ySampling) != (1, 1) for channel in channels):
        raise ValueError("some of its channels have fewer pixels than others")
    return east - west + 1, south - north + 1, len(channels), 4


READERS = ((files.PNG, _by_pillow("PNG")), (files.JPEG, _by_pillow("JPEG")), (b"BM", _bmp),
            (b"P6", _plain), (b"PF", _plain), (b"Pf", _plain), (files.EXR, _exr))


def _shown(error):
    text = " ".join(str(error).split())
    return text if len(text) <= 100 else f"{text[:97]}..."

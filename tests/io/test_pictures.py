"""Pictures and volumes before Mitsuba sees them: those that claim too much, and those that its readers run wild on."""
import io
import struct

import numpy as np
import OpenEXR
import pytest
from mesh_files import damaged
from picture_files import png_of
from PIL import Image

from mitsonar.io.scene_files import pictures

pytestmark = pytest.mark.usefixtures("two_threads")        # some are EXR
PIXELS = np.arange(60, dtype=np.uint8).reshape(6, 10) * 4


def encoded(kind, pixels=PIXELS, **options):
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **options)
    return file.getvalue()


def exr(pixels=PIXELS, **attributes):
    file = io.BytesIO()
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    OpenEXR.File(header, {"Y": pixels.astype(np.float32)}).write(file)
    return file.getvalue()


COLOURS = np.repeat(PIXELS[..., None], 3, 2)
SOUND = {"png": encoded("PNG"), "png of 16 bits": encoded("PNG", PIXELS.astype(np.uint16) * 256),
         "png in colours": encoded("PNG", COLOURS),
         "jpeg": encoded("JPEG"), "jpeg in colours": encoded("JPEG", COLOURS),
         "exr": exr(), "ppm": encoded("PPM", COLOURS), "bmp": encoded("BMP", COLOURS),
         "pfm": b"Pf\n10 6\n-1.0\n" + PIXELS.astype("<f4").tobytes()}


@pytest.fixture
def checked(tmp_path):
    def check(content):
        path = tmp_path / "picture"
        path.write_bytes(content)
        pictures.check(path)
        return str(path)
    return check


@pytest.mark.parametrize("content", SOUND.values(), ids=SOUND)
def test_sound_pictures_pass_and_mitsuba_reads_them(checked, variant, content):
    import mitsuba as mi

    assert tuple(mi.Bitmap(checked(content)).size()) == (10, 6)


@pytest.mark.parametrize("content, words", [
    (png_of(11000, 11000), "has 11000 x 11000 pixels of 1 channel, and a texture may have 100,000,000"),
    (png_of(20000, 20000), "Image size (400000000 pixels) exceeds limit"),
    (png_of(60000, 60000), "Image size (3600000000 pixels) exceeds limit"), (png_of(0, 60), "its header is damaged"),
    (b"P6 20000 20000 255\n" + bytes(60), "it claims 20000 x 20000 pixels, and has 79 bytes"),
    (b"PF -1 6 -1\n", "its header is damaged"), (b"P6 " + b"9" * 300 + b" 6 255\n", "it claims 9"),
    (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 6 +X 10\n" + bytes(240), "or no picture that can be read; give a PNG"),
    (encoded("TGA"), "or no picture that can be read; give a PNG"), (b"", "or no picture that can be read"),
    (encoded("BMP").replace(b"\6\0\0\0", b"\0\0\0\0", 1), "10 x 0 pixels of 1 channel"),
    (encoded("BMP").replace(b"\n\0\0\0", b"\n\0\0\1", 1), "it claims 16777226 x 6 pixels"),
    (encoded("JPEG").replace(struct.pack(">HH", 6, 10), b"\xea\x60\xea\x60", 1), "60000"),
    (exr()[:100], "it is not an OpenEXR file, or is cut short"),
], ids=["large png", "huge png", "endless png", "flat png", "huge ppm", "pfm", "digits", "radiance",
        "targa", "empty", "flat bmp", "huge bmp", "huge jpeg", "cut exr"])
def test_pictures_that_are_refused(checked, content, words):
    with pytest.raises(ValueError, match="the picture .*(cannot be read|is cut short|pixels)") as error:
        checked(content)
    assert words in str(error.value) and len(str(error.value)) < 700


def test_exr_that_claims_a_large_window(checked):
    window = np.zeros(2, np.int32), np.array([9, 5], np.int32)
    content = exr(dataWindow=window)
    corner = struct.pack("<4i", 0, 0, 9, 5)
    assert content.count(corner) >= 1
    with pytest.raises(ValueError, match="100000 x 100000 pixels|not an OpenEXR file"):
        checked(content.replace(corner, struct.pack("<4i", 0, 0, 99999, 99999)))


@pytest.mark.parametrize("shape, kind, words", [
    ((2, 3, 4, 1), 1, None), ((2, 3, 4000, 1), 1, "claims 2 x 3 x 4000 x 1 numbers of type 1, and has 144 bytes"),
    ((-2, -3, 4, 1), 1, "claims -2"), ((2, 3, 4, 1), 2, "of type 2"),
])
def test_volumes(tmp_path, shape, kind, words):
    (tmp_path / "grid.vol").write_bytes(b"VOL\3" + struct.pack("<5i6f", kind, *shape, *6 * [0.0]) + bytes(96))
    if words is None:
        pictures.check_volume(tmp_path / "grid.vol")
        return
    with pytest.raises(ValueError, match="the volume ") as error:
        pictures.check_volume(tmp_path / "grid.vol")
    assert words in str(error.value)


@pytest.mark.parametrize("content", SOUND.values(), ids=SOUND)
def test_what_passes_is_a_picture_to_mitsuba_or_an_error(checked, variant, rng, content):
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    for _ in range(60):
        try:
            path = checked(damaged(content, rng))
        except ValueError as error:
            assert "\n" not in str(error) and len(str(error)) < 700
            continue
        try:
            assert np.prod(mi.Bitmap(path).size()) <= pictures.MOST_PIXELS
        except (RuntimeError, UnicodeDecodeError):
            continue

"""The commands that make what sidescan software and GIS read: convert, mosaic."""
import datetime
import os

from .arguments import Commands, number, whole
from .completion import FILES, complete_with
from .words import announce, warn

RECORDS = (".exr", ".nc")
GAINS = ("seabed", "target", "none")


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    convert = commands.add_parser("convert", help="write sidescan images as XTF; EXR as netCDF and back; focused "
                                                  "images as GeoTIFF; all as HDF5")
    complete_with(convert.add_argument("images", metavar="IN.exr", nargs="+",
                                       help="EXR or netCDF; for XTF several frequencies of one track"), FILES)
    complete_with(convert.add_argument("output", metavar="OUT.xtf|nc|exr|tif|h5"), FILES)
    convert.add_argument("--tvg", default="seabed", choices=GAINS,
                         help="gain over range in the samples of an XTF; its scale is written beside them")
    convert.add_argument("--start", metavar="DATE", help="of time 0, such as 2026-05-01T10:00:00Z; default: 1970")
    convert.add_argument("--coordinates", choices=("degrees", "metres"),
                         help="of an XTF's positions; default: degrees where the scene's coordinate system is known")
    convert.set_defaults(run=_convert)

    mosaic = commands.add_parser("mosaic", help="lay sidescan images on a map, as a GeoTIFF")
    complete_with(mosaic.add_argument("images", metavar="IN.exr", nargs="+", help="EXR or netCDF"), FILES)
    complete_with(mosaic.add_argument("-o", "--output", metavar="OUT.tif", required=True), FILES)
    mosaic.add_argument("--resolution", type=number, metavar="M",
                        help="side of a cell; default: the longer of a bin and the way between pings")
    mosaic.add_argument("--quantity", default="level", metavar="NAME",
                        help="level (default), mean_level, label, class, shadow, seabed_depth, ...")
    mosaic.add_argument("--place", default="flat", choices=("flat", "truth"),
                        help="of bins: a level bed below each ping (default), or where the image knows their bed")
    mosaic.add_argument("--blend", default="nearest", choices=("nearest", "feather", "mean"),
                        help="of swaths: the nearest track (default), less weight towards the edges, or all alike")
    mosaic.add_argument("--gain", default="seabed", choices=(*GAINS[:2], "angle", "none"),
                        help="of levels: over range, or for the same median at every angle from nadir")
    mosaic.add_argument("--fill", type=number, metavar="M",
                        help="pings farther apart leave a hole; default: four cells or twice the way between pings")
    mosaic.add_argument("--nadir", type=number, default=0.0, metavar="DEG",
                        help="leave empty what is steeper, from the vertical; default: 0")
    mosaic.add_argument("--epsg", type=whole, metavar="N",
                        help="coordinate system; default: that of the first image")
    mosaic.set_defaults(run=_mosaic)


def _convert(arguments):
    from mitsonar.device.files import check_writable
    from mitsonar.io import reading
    from mitsonar.io.records import hdf5

    suffix = os.path.splitext(arguments.output)[1].lower()
    if suffix not in (".xtf", *RECORDS, *reading.GEOTIFF, *hdf5.SUFFIXES):
        raise ValueError(f"cannot write {arguments.output}: its name says no kind of file; let it end in .xtf, .nc, "
                         ".exr, .tif or .h5. Lines of soundings are converted by `mitsonar soundings`.")
    check_writable(arguments.output)
    if suffix == ".xtf":
        _write_xtf(arguments)
        return
    if len(arguments.images) > 1:
        raise ValueError(f"{len(arguments.images)} images do not go into one {suffix[1:]} file; give one.")
    asked = [f"--{name}" for name, plain in (("tvg", "seabed"), ("start", None), ("coordinates", None))
             if getattr(arguments, name) != plain]
    if asked:
        raise ValueError(f"{asked[0]} is of XTF files; leave it out.")
    reading.write(_image(arguments.images[0]), arguments.output)
    announce(arguments.output)


def _mosaic(arguments):
    from mitsonar.device.files import check_writable
    from mitsonar.imaging.maps.mosaics import mosaic
    from mitsonar.io.records import geotiff

    if os.path.splitext(arguments.output)[1].lower() not in (".tif", ".tiff"):
        raise ValueError(f"cannot write {arguments.output}: its name must end in .tif.")
    check_writable(arguments.output)
    chart = mosaic([_image(path) for path in arguments.images], arguments.resolution, quantity=arguments.quantity,
                   place=arguments.place, blend=arguments.blend,
                   gain=None if arguments.gain == "none" else arguments.gain, fill=arguments.fill,
                   nadir_deg=arguments.nadir, crs=None if arguments.epsg is None else f"EPSG:{arguments.epsg}")
    geotiff.write(chart, arguments.output)
    announce(arguments.output)
    if chart.attrs["crs"] is None:
        warn("the images name no coordinate system, so the map is in plain metres; say it by --epsg")


def _write_xtf(arguments):
    from mitsonar.io.xtf import xtf

    start = _seconds(arguments.start)
    images = [_image(path) for path in arguments.images]
    wanted = None if arguments.coordinates is None else arguments.coordinates == "degrees"
    written = xtf.write(images, arguments.output, tvg=None if arguments.tvg == "none" else arguments.tvg, start=start,
                        geographic=wanted)
    announce(arguments.output)
    scales = "; ".join(scale.words() for scale in written.scales)
    full = f", {written.saturated} of them saturated" if written.saturated else ""
    warn(f"samples n at slant range R [m] are {scales}{full}; positions are in "
         f"{'degrees' if written.geographic else 'metres'}; XTF has no room for {', '.join(written.left_out)}, "
         "refraction and the scene: keep the image for them")


def _image(path):
    import xarray as xr

    from mitsonar.device.files import check_readable
    from mitsonar.io import reading

    check_readable(path, "the image", "an EXR or netCDF file")
    image = reading.read(path)
    if not isinstance(image, xr.Dataset):
        raise ValueError(f"{path} holds no image; give an EXR or netCDF file that mitsonar rendered.")
    return image


def _seconds(text):
    """Seconds since 1970 of a date with time."""
    if text is None:
        return 0.0
    try:
        date = datetime.datetime.fromisoformat(text.strip().removesuffix("Z"))
    except ValueError:
        raise ValueError(f"--start is {text!r}; give a date and time such as 2026-05-01T10:00:00Z.") from None
    return (date if date.tzinfo else date.replace(tzinfo=datetime.timezone.utc)).timestamp()

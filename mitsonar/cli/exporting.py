"""The commands that write files for sidescan software, GIS and robots: raster, convert, mosaic, grid, bag."""
import datetime
import importlib
import os
import re

from .arguments import GAINS, Commands, add_gain, check_output, gain, number, whole
from .completion import add_file
from .words import announce, warn

RECORDS, PICTURE, GEOTIFFS = (".exr", ".nc"), ".png", (".tif", ".tiff")
SIDESCANS = {".xtf": "mitsonar.io.xtf.xtf", ".jsf": "mitsonar.io.sidescan_lines.jsf_file"}     # modules that write
NEEDED = ("x", "y", "depth", "valid", "uncertainty")
LAYERS = ("depth", "count", "deviation", "uncertainty")


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    raster = commands.add_parser("raster", help="draw fans of beams as pictures in metres, with their labels")
    add_file(raster, "image", metavar="IN.exr", help="image of a fan or a rotating head")
    raster.add_argument("-o", "--output", metavar="OUT.exr|nc|png",
                        help="all frames with their labels, or the grey levels of one frame; default: IN_raster.exr")
    raster.add_argument("--cell", type=float, metavar="M",
                        help="side of a cell; default: a bin, with at most 1024 cells a side")
    raster.add_argument("--only", metavar="NAMES", help="variables to write, such as \"level, label\"; default: all")
    raster.add_argument("--frame", type=whole, metavar="N",
                        help="number of the only frame to draw, from 0; default: all, in a PNG the first")
    raster.set_defaults(run=_raster)

    convert = commands.add_parser("convert", help="convert sidescan images to XTF or JSF, EXR to netCDF and back, "
                                                  "focused images to GeoTIFF, and any image to HDF5")
    add_file(convert, "images", metavar="IN.exr", nargs="+",
             help="EXR or netCDF; for XTF and JSF several frequencies of one track")
    add_file(convert, "output", metavar="OUT.xtf|jsf|nc|exr|tif|h5", help="converted image")
    add_gain(convert, "seabed", "gain over range in the samples of an XTF or JSF, whose scale is printed",
             [name for name in GAINS if name != "recorder"])
    convert.add_argument("--start", metavar="DATE",
                         help="date of time 0, such as 2026-05-01T10:00:00Z; default: 1970")
    convert.add_argument("--coordinates", choices=("degrees", "metres"),
                         help="unit of positions in an XTF or JSF; default: degrees if the coordinate system is known")
    convert.set_defaults(run=_convert)

    mosaic = commands.add_parser("mosaic", help="lay sidescan images on a map, as a GeoTIFF")
    add_file(mosaic, "images", metavar="IN.exr", nargs="+", help="EXR or netCDF")
    mosaic.add_argument("--resolution", type=number, metavar="M",
                        help="side of a cell; default: the longer of a bin and the distance between pings")
    mosaic.add_argument("--quantity", default="level", metavar="NAME",
                        help="level (default), mean_level, label, class, shadow, seabed_depth, ...")
    mosaic.add_argument("--place", default="flat", choices=("flat", "truth"),
                        help="position of bins: on a level bed below each ping (default), or at the image's true depth")
    mosaic.add_argument("--blend", default="nearest", choices=("nearest", "feather", "mean"),
                        help="rule for overlapping swaths: nearest track (default), less weight to edges, or the mean")
    mosaic.add_argument("--gain", default="seabed", choices=("seabed", "target", "angle", "none"),
                        help="gain of levels: over range; or angle: equal medians at every angle from nadir")
    mosaic.add_argument("--fill", type=number, metavar="M",
                        help="fill gaps up to this distance between pings; default: four cells or twice the usual "
                             "distance")
    mosaic.add_argument("--nadir", type=number, default=0.0, metavar="DEG",
                        help="leave out angles nearer to the vertical; default: 0")
    mosaic.add_argument("--epsg", type=whole, metavar="N", help="coordinate system; default: that of the first image")
    mosaic.set_defaults(run=_mosaic)

    grid = commands.add_parser("grid", help="lay lines of soundings on a map, as a GeoTIFF, BAG or S-102")
    add_file(grid, "lines", metavar="LINE", nargs="+", help=".nc, .gsf, .kmall, .all, .s7k, .xtf or .hsx")
    grid.add_argument("--cell", type=number, default=1.0, metavar="M", help="side of a cell; default: 1")
    grid.add_argument("--rule", default="mean", choices=("mean", "weighted", "shoalest"),
                      help="combination of the depths in a cell; weighted: by their uncertainties")
    grid.add_argument("--least", type=whole, default=1, metavar="N",
                      help="least number of soundings in a cell; default: 1")
    grid.add_argument("--layer", default="depth", choices=LAYERS, help="quantity of a GeoTIFF; default: depth")
    grid.set_defaults(run=_grid)
    add_file(mosaic, "-o", "--output", metavar="OUT.tif", required=True, help="map")
    add_file(grid, "-o", "--output", metavar="OUT.tif|bag|h5", required=True,
             help="map; a BAG and an S-102 (.h5) hold depth and uncertainty")

    bag = commands.add_parser("bag", help="write records as a bag of ROS 2; or read a vehicle's bag: its track as that "
                                          "of a scene, its sonar's images as records")
    add_file(bag, "records", metavar="RECORD", nargs="+",
             help="images or soundings (.exr, .nc), recorded lines (.all, .kmall, .gsf, .s7k, .xtf, .hsx); or one bag")
    add_file(bag, "-o", "--output", metavar="OUT.mcap|xml|nc|exr", required=True,
             help="bag; of a bag, a scene with its track (.xml, with --like) or its sonar's images (.nc, .exr)")
    bag.add_argument("--start", metavar="DATE",
                     help="date of time 0, such as 2026-05-01T10:00:00Z; default: that of the record, or 1970")
    bag.add_argument("--cell", type=number, metavar="M",
                     help="also draw fans of beams as pictures in metres with cells of this side")
    add_file(bag, "--like", metavar="SCENE", shipped=True, help="scene whose world and sonar the track is sailed in")
    bag.add_argument("--topic", metavar="NAME", help="topic of the track, or of the images, to read")
    bag.add_argument("--pings", metavar="FIRST:END",
                     help="images to read, by their numbers from 0, such as 0:500; default: all")
    bag.add_argument("--shift", nargs=3, type=number, metavar=("EAST", "NORTH", "UP"),
                     help="place of the track's origin in the scene [m]; default: 0 0 0")
    bag.set_defaults(run=_bag)


def _raster(arguments):
    from mitsonar.imaging.maps.raster import bearings, cartesian
    from mitsonar.io import reading
    from mitsonar.io.records import exr

    output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_raster.exr"
    suffix = check_output(output, (*RECORDS, PICTURE))
    if suffix == PICTURE and arguments.only is not None:
        raise ValueError("a PNG shows levels only; leave --only out, or write an .exr or .nc.")
    dataset = exr.read(arguments.image)
    frame = arguments.frame if arguments.frame is not None or suffix != PICTURE else 0
    if frame is not None:
        _, pings = bearings(dataset)
        if not 0 <= frame < len(pings):
            raise ValueError(f"there is no frame {frame}; there are {len(pings)}, the first is 0.")
        dataset = dataset.isel(ping=pings[frame])
    if suffix == PICTURE:
        _write_grey(dataset, output, arguments.cell)
    else:
        names = None if arguments.only is None else [name.strip() for name in arguments.only.split(",")]
        reading.write(cartesian(dataset, arguments.cell, names=names), output)
    announce(output)


def _write_grey(dataset, path, cell):
    from mitsonar.device.files import replacing
    from mitsonar.labels.frames import frames
    from mitsonar.labels.pictures import greys, write_png

    frame, = frames(dataset, "the record", "cartesian", cell)
    picture = greys(dataset, [frame]).draw(frame)
    with replacing(path) as temporary:
        write_png(picture, temporary)


def _convert(arguments):
    from mitsonar.io import reading
    from mitsonar.io.records import hdf5

    suffix = check_output(arguments.output, (*SIDESCANS, *RECORDS, *reading.GEOTIFF, *hdf5.SUFFIXES),
                          "; lines of soundings are converted by `mitsonar soundings`")
    if suffix in SIDESCANS:
        _write_sidescan(arguments, SIDESCANS[suffix])
        return
    if len(arguments.images) > 1:
        raise ValueError(f"{len(arguments.images)} images do not go into one {suffix[1:]} file; give one.")
    asked = [f"--{name}" for name, usual in (("tvg", "seabed"), ("start", None), ("coordinates", None))
             if getattr(arguments, name) != usual]
    if asked:
        raise ValueError(f"{asked[0]} applies to XTF and JSF files only; leave it out.")
    reading.write(_image(arguments.images[0]), arguments.output)
    announce(arguments.output)


def _mosaic(arguments):
    from mitsonar.imaging.maps.mosaics import mosaic

    check_output(arguments.output, GEOTIFFS)
    _write_map(mosaic([_image(path) for path in arguments.images], arguments.resolution, quantity=arguments.quantity,
                      place=arguments.place, blend=arguments.blend,
                      gain=None if arguments.gain == "none" else arguments.gain, fill=arguments.fill,
                      nadir_deg=arguments.nadir, crs=None if arguments.epsg is None else f"EPSG:{arguments.epsg}"),
               arguments.output, "the images name no coordinate system, so the map is in plain metres; give --epsg")


def _grid(arguments):
    from mitsonar.hydrography.gridding import gridded
    from mitsonar.io import survey_lines
    from mitsonar.io.grids import surfaces

    suffix = check_output(arguments.output, (*GEOTIFFS, *surfaces.SUFFIXES))
    if suffix in surfaces.SUFFIXES and arguments.layer != "depth":
        raise ValueError(f"--layer chooses the quantity of a GeoTIFF, and {suffix} files hold depth and uncertainty; "
                         "leave it out.")
    blocks = [block[[name for name in NEEDED if name in block]].assign_attrs(block.attrs)
              for path in arguments.lines for block in survey_lines.read_blocks(path, column=False)]
    chart = gridded(blocks, arguments.cell, rule=arguments.rule, least=arguments.least)
    if suffix in surfaces.SUFFIXES:
        remarks = surfaces.write(chart, arguments.output)
        announce(arguments.output)
        for remark in remarks:
            warn(remark)
        return
    if arguments.layer not in chart:
        raise ValueError(f"there is no {arguments.layer} without the rule weighted; give --rule weighted.")
    _write_map(chart[[arguments.layer]], arguments.output,
               "the lines name no coordinate system, so the map is in plain metres")


def _bag(arguments):
    from mitsonar.io.bags import bag

    suffix = check_output(arguments.output, (bag.SUFFIX, ".xml", ".nc", ".exr"))
    if suffix != bag.SUFFIX:
        _read_bag(arguments, suffix)
        return
    _refuse(arguments, ("like", "topic", "shift", "pings"), "reads a bag, and this writes one")
    start = None if arguments.start is None else _seconds(arguments.start)
    written = bag.write_files(arguments.records, arguments.output, start=start, cell=arguments.cell)
    announce(arguments.output)
    warn("messages: " + ", ".join(f"{count} of {topic}" for topic, count in sorted(written.items())))


def _read_bag(arguments, suffix):
    """Write a scene with the track of a bag, or the images of its sonar."""
    from mitsonar.io import reading
    from mitsonar.io.bags import recorded
    from mitsonar.planning.twins.like_bag import like_bag

    if len(arguments.records) > 1:
        raise ValueError(f"{len(arguments.records)} bags are given, and one is read at a time; give one.")
    _refuse(arguments, ("start", "cell"), "writes a bag, and this reads one")
    path, = arguments.records
    if suffix == ".xml":
        if arguments.like is None:
            raise ValueError("a track needs a world and a sonar; give --like SCENE.xml.")
        _refuse(arguments, ("pings",), "reads images, and this reads a track")
        for written in like_bag(path, arguments.like, arguments.output, topic=arguments.topic,
                                shift=arguments.shift or (0.0, 0.0, 0.0)):
            announce(written)
        return
    _refuse(arguments, ("like", "shift"), "makes a scene, and this reads images")
    stem = os.path.splitext(arguments.output)[0]
    pings = None
    if arguments.pings is not None:
        limits = re.fullmatch(r"(\d*):(\d*)", arguments.pings)
        if limits is None:
            raise ValueError(f"--pings is {arguments.pings!r}; give numbers such as 0:500, 500: or :500.")
        pings = slice(*(int(limit) if limit else None for limit in limits.groups()))
    images = recorded.read_images(path, topic=arguments.topic, track=recorded.track_if_any(path), pings=pings)
    for run, image in enumerate(images, 1):
        output = arguments.output if run == 1 else f"{stem}_{run}{suffix}"
        reading.write(image, output)
        announce(output)


def _refuse(arguments, names, why):
    """Raise `ValueError` for an option that has no meaning here."""
    for name in names:
        if getattr(arguments, name) is not None:
            raise ValueError(f"--{name} {why}; leave it out.")


def _write_map(chart, path, without_crs):
    from mitsonar.io.records import geotiff

    geotiff.write(chart, path)
    announce(path)
    if chart.attrs["crs"] is None:
        warn(without_crs)


def _write_sidescan(arguments, module):
    start = _seconds(arguments.start)
    images = [_image(path) for path in arguments.images]
    geographic = None if arguments.coordinates is None else arguments.coordinates == "degrees"
    written = importlib.import_module(module).write(images, arguments.output, tvg=gain(arguments), start=start,
                                                    geographic=geographic)
    announce(arguments.output)
    scales = "; ".join(scale.words() for scale in written.scales)
    full = f", {written.saturated} of them saturated" if written.saturated else ""
    weights = "" if module == SIDESCANS[".xtf"] else " A sample of a JSF counts as n once multiplied by 2^-weight."
    warn(f"samples n at slant range R [m] are {scales}{full}; positions are in "
         f"{'degrees' if written.geographic else 'metres'}; the file has no room for {', '.join(written.left_out)}, "
         f"refraction and the scene: keep the image for them.{weights}")


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
    """Return the seconds since 1970 of a date with time."""
    if text is None:
        return 0.0
    try:
        date = datetime.datetime.fromisoformat(text.strip().removesuffix("Z"))
    except ValueError:
        raise ValueError(f"--start is {text!r}; give a date and time such as 2026-05-01T10:00:00Z.") from None
    return (date if date.tzinfo else date.replace(tzinfo=datetime.timezone.utc)).timestamp()

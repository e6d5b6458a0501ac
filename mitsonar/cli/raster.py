"""The command that draws fans and turns of a head in metres: raster."""
import os

from .arguments import Commands, whole
from .completion import FILES, complete_with
from .words import announce

RECORDS, PICTURE = (".exr", ".nc"), ".png"


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    raster = commands.add_parser("raster", help="draw fans of beams as pictures in metres, with their labels")
    complete_with(raster.add_argument("image", metavar="IN.exr"), FILES)
    raster.add_argument("-o", "--output", metavar="OUT.exr|nc|png",
                        help="all frames with their labels, or the levels of one in grey; default: IN_raster.exr")
    raster.add_argument("--cell", type=float, metavar="M", help="side of an element; default: what fits 1024")
    raster.add_argument("--only", metavar="NAMES", help="of the variables; default: all; \"level, label\"")
    raster.add_argument("--frame", type=whole, metavar="N", help="the only one to draw; of a PNG the first by default")
    raster.set_defaults(run=_raster)


def _raster(arguments):
    from mitsonar.device.files import check_writable
    from mitsonar.imaging.maps.raster import bearings, cartesian
    from mitsonar.io import reading
    from mitsonar.io.records import exr

    output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_raster.exr"
    suffix = os.path.splitext(output)[1].lower()
    if suffix not in (*RECORDS, PICTURE):
        raise ValueError(f"cannot write {output}: its name says no kind of file; let it end in .exr, .nc or .png.")
    if suffix == PICTURE and arguments.only is not None:
        raise ValueError("a PNG shows levels only; leave --only out, or write an .exr or .nc.")
    check_writable(output)
    dataset = exr.read(arguments.image)
    number = arguments.frame if arguments.frame is not None or suffix != PICTURE else 0
    if number is not None:
        _, pings = bearings(dataset)
        if not 0 <= number < len(pings):
            raise ValueError(f"there is no frame {number}; there are {len(pings)}, the first is 0.")
        dataset = dataset.isel(ping=pings[number])
    if suffix == PICTURE:
        _write_grey(dataset, output, arguments.cell)
    else:
        names = None if arguments.only is None else [name.strip() for name in arguments.only.split(",")]
        reading.write(cartesian(dataset, arguments.cell, names=names), output)
    announce(output)


def _write_grey(dataset, path, cell):
    from mitsonar.dataset.labels.frames import frames
    from mitsonar.dataset.labels.pictures import greys, write_png
    from mitsonar.device.files import replacing

    frame, = frames(dataset, "the record", "cartesian", cell)
    picture = greys(dataset, [frame]).draw(frame)
    with replacing(path) as temporary:
        write_png(picture, temporary)

"""The command grid: soundings of one or more lines on the square cells of a map."""
import os

from .arguments import Commands, number, whole
from .completion import FILES, complete_with
from .words import announce, warn

NEEDED = ("x", "y", "depth", "valid", "uncertainty")
LAYERS = ("depth", "count", "deviation", "uncertainty")


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    command = commands.add_parser("grid", help="lay lines of soundings on a map, as a GeoTIFF")
    complete_with(command.add_argument("lines", metavar="LINE", nargs="+", help=".nc, .gsf, .kmall or .all"), FILES)
    complete_with(command.add_argument("-o", "--output", metavar="OUT.tif", required=True), FILES)
    command.add_argument("--cell", type=number, default=1.0, metavar="M", help="side of a cell; default: 1")
    command.add_argument("--rule", default="mean", choices=("mean", "weighted", "shoalest"),
                         help="what becomes of the depths in a cell; weighted: by their uncertainties")
    command.add_argument("--least", type=whole, default=1, metavar="N",
                         help="soundings that a cell must have; default: 1")
    command.add_argument("--layer", default="depth", choices=LAYERS, help="what is written; default: depth")
    command.set_defaults(run=_grid)


def _grid(arguments):
    from mitsonar.device.files import check_writable
    from mitsonar.hydrography.gridding import gridded
    from mitsonar.io import survey_lines
    from mitsonar.io.records import geotiff

    if os.path.splitext(arguments.output)[1].lower() not in (".tif", ".tiff"):
        raise ValueError(f"cannot write {arguments.output}: its name must end in .tif.")
    check_writable(arguments.output)
    blocks = [block[[name for name in NEEDED if name in block]].assign_attrs(block.attrs)
              for path in arguments.lines for block in survey_lines.read_blocks(path, column=False)]
    chart = gridded(blocks, arguments.cell, rule=arguments.rule, least=arguments.least)
    if arguments.layer not in chart:
        raise ValueError(f"there is no {arguments.layer} without the rule weighted; give --rule weighted.")
    geotiff.write(chart[[arguments.layer]], arguments.output)
    announce(arguments.output)
    if chart.attrs["crs"] is None:
        warn("the lines name no coordinate system, so the map is in plain metres")

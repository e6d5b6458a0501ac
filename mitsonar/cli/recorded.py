"""The command that makes a scene like a recorded line: like."""
from .arguments import Commands, number, whole
from .completion import FILES, complete_with
from .words import announce, warn


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    like = commands.add_parser("like", help="make a scene like a recorded line: its track, cast, sounder and bed")
    complete_with(like.add_argument("line", metavar="LINE.all|kmall|gsf", help="a line of soundings"), FILES)
    complete_with(like.add_argument("-o", "--output", required=True, metavar="SCENE.xml",
                                    help="what it names is written beside it"), FILES)
    like.add_argument("--cell", type=number, metavar="M", help="of the bed's grid; default: as the soundings are dense")
    like.add_argument("--pings", type=whole, metavar="N", help="the first ones; default: all")
    like.set_defaults(run=_like)


def _like(arguments):
    from mitsonar.planning.like_line import like

    if arguments.cell is not None and not 0 < arguments.cell < 1e4:
        raise ValueError(f"--cell is {arguments.cell:g} m; give a number above 0, up to 10 000.")
    if arguments.pings is not None and arguments.pings < 2:
        raise ValueError(f"--pings is {arguments.pings}; a track takes two or more.")
    for path in like(arguments.line, arguments.output, cell=arguments.cell, say=warn,
                     pings=None if arguments.pings is None else slice(0, arguments.pings)):
        announce(path)

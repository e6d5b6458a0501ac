"""The command fit-profile: the sound-speed profile that soundings came through, or why they cannot tell it."""
import os

from mitsonar.device.files import check_writable, replacing

from .arguments import Commands, number, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import announce


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    command = commands.add_parser("fit-profile", help="find the sound-speed profile from lines of soundings that "
                                                      "overlap or cross, or say why they cannot tell it")
    complete_with(command.add_argument("lines", metavar="LINE", nargs="+", help=".nc, .gsf, .kmall or .all"), FILES)
    complete_with(command.add_argument("-o", "--output", metavar="OUT.nc",
                                       help="write the answer there: speeds, deviations, what was seen"), FILES)
    complete_with(command.add_argument("--profile", metavar="OUT.csv",
                                       help="write the profile there as a cast; refused where there is none"), FILES)
    complete_with(command.add_argument("--picture", metavar="OUT.png", help="draw it: .png, .pdf or .svg"), FILES)
    complete_with(command.add_argument("--cast", metavar="CAST",
                                       help="believed of the water; default: the cast of the first line"), FILES)
    command.add_argument("--nodes", type=whole, default=12, metavar="N",
                         help="steps from the head down to the deepest sounding; default: 12")
    command.add_argument("--noise", type=number, default=20.0, metavar="US",
                         help="standard deviation of two-way times, in microseconds; default: 20")
    command.add_argument("--deviation", type=number, default=10.0, metavar="M/S",
                         help="of the believed speeds; default: 10")
    command.add_argument("--length", type=number, metavar="M",
                         help="in depth, over which speeds belong together; default: a sixth of the depth")
    command.add_argument("--cell", type=number, metavar="M",
                         help="distance of the bed's nodes; default: as the soundings allow")
    command.add_argument("--under-way", action="store_true",
                         help="places count the way that the vessel made while echoes came in, as those of scenes do")
    command.set_defaults(run=_fit)


def _fit(arguments):
    written = {"output": (".nc",), "profile": (".csv",), "picture": (".png", ".pdf", ".svg")}
    for name, suffixes in written.items():
        path = getattr(arguments, name)
        if path is not None:
            if os.path.splitext(path)[1].lower() not in suffixes:
                raise ValueError(f"cannot write {path}: its name must end in {' or '.join(suffixes)}.")
            check_writable(path)
            if os.path.exists(path) and any(os.path.exists(line) and os.path.samefile(path, line)
                                            for line in arguments.lines):
                raise ValueError(f"{path} is one of the lines; give another name.")
    from mitsonar.inversion.profile.profile import fit_lines
    from mitsonar.io import casts
    from mitsonar.io.records import netcdf

    start = None if arguments.cast is None else casts.read(arguments.cast).profile
    steps = 30
    with Progress("steps", "fitting") as progress:
        fit = fit_lines(arguments.lines, start, nodes=arguments.nodes, noise=1e-6 * arguments.noise,
                        deviation=arguments.deviation, length=arguments.length, cell=arguments.cell,
                        under_way=arguments.under_way, iterations=steps, progress=lambda done, _: progress(done, steps))
    profile = None if arguments.profile is None else fit.profile        # refused before anything is written
    announce(f"{fit.verdict[0].upper()}{fit.verdict[1:]}")
    if arguments.output is not None:
        netcdf.write(fit.to_dataset(), arguments.output)
        announce(arguments.output)
    if arguments.profile is not None and profile is not None:
        rows = [f"{depth:.3f},{speed:.3f}" for depth, speed in zip(profile.depth, profile.sound_speed)]
        with replacing(arguments.profile) as temporary:
            temporary.write_text("\n".join(["depth,sound_speed", *rows, ""]), encoding="utf-8")
        announce(arguments.profile)
    if arguments.picture is not None:
        from mitsonar.plots.canvas import save
        from mitsonar.plots.sheets.profile_fit import profile_fit_figure

        save(profile_fit_figure(fit.to_dataset()), arguments.picture)
        announce(arguments.picture)

"""The command that fits what is in a scene to a record: fit."""
import argparse
import os
from pathlib import Path

from .arguments import Commands, number, parameters, set_up, whole
from .completion import FILES, SCENES, complete_with
from .progress import Progress
from .words import InterruptSignals, announce

OPTIONS = ("looks", "length", "model_error", "sensor", "seed", "iterations", "noise", "method", "directions", "state",
           "truth", "deviation", "strength", "farthest", "class", "cast", "nodes", "cell", "under_way", "profile")


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    from mitsonar.inversion.problems import PROBLEMS

    problems = "".join(f"  {name} {one.asks}\n      {one.summary}\n" for name, one in PROBLEMS.items())
    fit = commands.add_parser("fit", help="fit parameters of a scene to a record, and say what the record tells",
                              formatter_class=argparse.RawDescriptionHelpFormatter,
                              epilog=f"problems with a name:\n{problems}")
    complete_with(fit.add_argument("what", metavar="SCENE|PROBLEM",
                                   help="a scene, with a RECORD (.exr, .nc) of its sonar and one KEY=DEVIATION or "
                                        "KEY=DEVIATION:LOWER:UPPER or more: parameters as mi.traverse names them, or "
                                        "OBJECT.heights, OBJECT.pose; or one of the problems below"), SCENES)
    complete_with(fit.add_argument("inputs", metavar="INPUT", nargs="*", help="what the scene or problem asks for"),
                  FILES)
    complete_with(fit.add_argument("-o", "--output", metavar="OUT.nc",
                                   help="the answer; may be left out with --profile"), FILES)
    complete_with(fit.add_argument("--picture", metavar="OUT.png",
                                   help="draw start, answer, what it may be off, and the truth where it is given"),
                  FILES)
    fit.add_argument("--iterations", type=whole, metavar="N", help="steps at most")
    fit.add_argument("--threads", type=whole, metavar="N", help="worker threads, at least 2; default: one per core")
    scene = fit.add_argument_group("of a scene")
    scene.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                       help="value for a $parameter of the scene; repeatable")
    scene.add_argument("--sensor", metavar="ID", help="which of the scene's sonars: its id; default: the first")
    scene.add_argument("--seed", type=whole, metavar="N", help="of the model's rays; default: 0")
    scene.add_argument("--looks", type=number, metavar="N", help="of the record's bins; default: 1, full speckle")
    scene.add_argument("--model-error", type=number, metavar="SHARE",
                       help="of intensities, that the scene's model is off by; default: 0.05")
    scene.add_argument("--length", type=number, metavar="M",
                       help="over which vertices' numbers belong together; default: each is on its own")
    scene.add_argument("--noise", type=number, metavar="SHARE",
                       help="of the deviance of noise, to stop at; default: 1; 0: go on to the most probable values")
    scene.add_argument("--method", choices=("trust-region", "l-bfgs"), help="default: trust-region")
    scene.add_argument("--directions", type=whole, metavar="N",
                       help="in which to look at what the record tells; default: 40")
    complete_with(scene.add_argument("--state", metavar="FILE.npz",
                                     help="written after each step; where it is there, the fit goes on with it"), FILES)
    complete_with(scene.add_argument("--truth", metavar="SCENE", help="to hold the answer against"), SCENES)
    heights = fit.add_argument_group("of heights, map and pose; so are -D, --sensor, --seed and --looks, and "
                                     "--directions and --length of some")
    heights.add_argument("--deviation", type=number, metavar="M|DB",
                         help="of the bed about a plane; default: 0.4; of the map about its mean; default: 6")
    heights.add_argument("--strength", metavar="KEY", help="of the bed, unknown then, such as bed.bsdf.strength")
    heights.add_argument("--class", action="append", metavar="NAME=DB", help="of a map: a sediment; repeatable")
    heights.add_argument("--farthest", type=number, metavar="M", help="slant range that counts; default: all")
    profile = fit.add_argument_group("of a profile; so are --iterations, --length (default: a sixth of the depth), "
                                     "--deviation [m/s] (default: 10) and --noise (of two-way times [us], default: 20)")
    complete_with(profile.add_argument("--profile", metavar="OUT.csv",
                                       help="write it there as a cast; refused where the soundings tell none"), FILES)
    complete_with(profile.add_argument("--cast", metavar="CAST",
                                       help="start and prior mean of the water; default: the cast of the first line"),
                  FILES)
    profile.add_argument("--nodes", type=whole, metavar="N",
                         help="steps from the head down to the deepest sounding; default: 12")
    profile.add_argument("--cell", type=number, metavar="M",
                         help="distance of the bed's nodes; default: as the soundings allow")
    profile.add_argument("--under-way", action="store_true", default=None,
                         help="places count the way that the vessel made while echoes came in, as those of scenes do")
    fit.set_defaults(run=_fit, behind_options="inputs")


def _fit(arguments):
    from mitsonar.device.files import check_writable, replacing

    if arguments.output is None and arguments.profile is None:
        raise ValueError("fit writes its answer to a file; give -o OUT.nc")
    for path, suffix in ((arguments.output, ".nc"), (arguments.profile, ".csv"), (arguments.picture, "")):
        if path is None:
            continue
        if suffix and os.path.splitext(path)[1].lower() != suffix:
            raise ValueError(f"cannot write {path}: its name must end in {suffix}")
        if not suffix:
            from mitsonar.plots.canvas import file_format

            file_format(path)
        check_writable(path)
        if os.path.exists(path) and any(os.path.exists(one) and os.path.samefile(path, one)
                                        for one in (arguments.what, *arguments.inputs)):
            raise ValueError(f"{path} is one of the inputs; give another name")
    from mitsonar.inversion.problems import solve
    from mitsonar.io.records import netcdf

    options = {name: value for name in OPTIONS if (value := getattr(arguments, name)) is not None}
    if arguments.parameters:
        options["parameters"] = parameters(arguments)
    set_up(arguments.threads)
    if arguments.state is not None and InterruptSignals.active is not None:
        InterruptSignals.active.left = Path(arguments.state)
    with Progress("steps", "fitting", at_most=True) as progress:
        solved = solve(arguments.what, arguments.inputs, options, progress)
    for sentence in solved.sentences:
        print(sentence.rstrip("."), flush=True)
    if arguments.output is not None:
        netcdf.write(solved.dataset, arguments.output)
        announce(arguments.output)
    if solved.profile is not None:
        rows = [f"{depth:.3f},{speed:.3f}" for depth, speed in zip(solved.profile.depth, solved.profile.sound_speed)]
        with replacing(arguments.profile) as temporary:
            temporary.write_text("\n".join(["depth,sound_speed", *rows, ""]), encoding="utf-8")
        announce(arguments.profile)
    if arguments.picture is not None:
        from mitsonar.plots.canvas import save
        from mitsonar.plots.sheets.fit_sheet import fit_figure

        save(fit_figure(solved.dataset), arguments.picture)
        announce(arguments.picture)

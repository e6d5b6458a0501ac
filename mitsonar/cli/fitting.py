"""The commands that check gradients and fit scenes to records: gradient-check, fit."""
import argparse
import os

from mitsonar.io.scene_files import scenes

from .arguments import (
    Commands,
    add_parameters,
    add_scene,
    add_threads,
    check_output,
    check_picture,
    number,
    parameters,
    set_up,
    whole,
)
from .completion import add_file
from .progress import Progress
from .words import announce, leave_if_interrupted, warn

OPTIONS = ("looks", "length", "model_error", "sensor", "seed", "iterations", "noise", "method", "directions", "state",
           "truth", "deviation", "strength", "farthest", "class", "cast", "nodes", "cell", "under_way", "profile")


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    check = commands.add_parser("gradient-check", help="compare forward and backward gradients of a scene's parameters "
                                                       "with finite differences, each parameter alone")
    add_scene(check)
    check.add_argument("keys", metavar="KEY", nargs="*",
                       help="parameter, as mi.traverse names it, such as bed.vertex_positions; default: all "
                            "differentiable parameters")
    check.add_argument("--directions", type=whole, default=3, metavar="N",
                       help="smooth random directions for each part of a parameter; default: 3")
    check.add_argument("--tolerance", type=number, default=0.01, metavar="SHARE",
                       help="largest relative error of a correct gradient; default: 0.01")
    check.add_argument("--allow-undecided", action="store_true",
                       help="exit with 0 if differences could not decide; default: exit with 1, as for a wrong "
                            "gradient")
    add_file(check, "-o", "--output", metavar="OUT.csv|nc", help="also write the table to a file")
    check.set_defaults(run=_check, behind_options="keys")

    from mitsonar.inversion.problems import PROBLEMS

    problems = "".join(f"  {name} {problem.asks}\n      {problem.summary}\n" for name, problem in PROBLEMS.items())
    fit = commands.add_parser("fit", help="fit parameters of a scene to a record, with their uncertainty",
                              formatter_class=argparse.RawDescriptionHelpFormatter,
                              epilog=f"problems with a name:\n{problems}")
    add_file(fit, "what", metavar="SCENE|PROBLEM", shipped=True,
             help="a scene, with a RECORD (.exr, .nc) of its sonar and one KEY=DEVIATION or KEY=DEVIATION:LOWER:UPPER "
                  "or more: parameters as mi.traverse names them, or OBJECT.heights, OBJECT.pose; or one of the "
                  "problems below")
    add_file(fit, "inputs", metavar="INPUT", nargs="*", help="inputs of the scene or problem")
    add_file(fit, "-o", "--output", metavar="OUT.nc", help="the answer; optional with --profile")
    add_file(fit, "--picture", metavar="OUT.png",
             help="draw the start, the answer, its uncertainty, and the truth where it is given")
    fit.add_argument("--iterations", type=whole, metavar="N", help="largest number of steps")
    add_threads(fit)
    scene = fit.add_argument_group("options of a scene")
    add_parameters(scene)
    scene.add_argument("--sensor", metavar="ID", help="id of one of the scene's sonars; default: the first")
    scene.add_argument("--seed", type=whole, metavar="N", help="random seed of the model's rays; default: 0")
    scene.add_argument("--looks", type=number, metavar="N",
                       help="number of looks in a bin of the record; default: 1, full speckle")
    scene.add_argument("--model-error", type=number, metavar="SHARE",
                       help="relative error of the model's intensities; default: 0.05")
    scene.add_argument("--length", type=number, metavar="M",
                       help="correlation length of values at vertices; default: none, each vertex on its own")
    scene.add_argument("--noise", type=number, metavar="SHARE",
                       help="stop at this share of the noise's deviance; default: 1; 0: go on to the most probable "
                            "values")
    scene.add_argument("--method", choices=("trust-region", "l-bfgs"), help="default: trust-region")
    scene.add_argument("--directions", type=whole, metavar="N",
                       help="directions in which to test how well the record determines the answer; default: 40")
    add_file(scene, "--state", metavar="FILE.npz",
             help="file written after each step; if it exists, the fit continues from it")
    add_file(scene, "--truth", metavar="SCENE", shipped=True, help="scene with the true values, for comparison")
    heights = fit.add_argument_group("options of heights, map and pose; they also take -D, --sensor, --seed and "
                                     "--looks, and some --directions and --length")
    heights.add_argument("--deviation", type=number, metavar="M|DB",
                         help="standard deviation of the bed about a plane, default: 0.4; of the map about its mean, "
                              "default: 6")
    heights.add_argument("--strength", metavar="KEY",
                         help="key of the bed's unknown strength, such as bed.bsdf.strength")
    heights.add_argument("--class", action="append", metavar="NAME=DB", help="sediment of a map; repeatable")
    heights.add_argument("--farthest", type=number, metavar="M", help="largest slant range to use; default: all")
    profile = fit.add_argument_group("options of a profile; it also takes --iterations, --length (default: a sixth of "
                                     "the depth), --deviation [m/s] (default: 10) and --noise (of two-way times [us], "
                                     "default: 20)")
    add_file(profile, "--profile", metavar="OUT.csv",
             help="write the profile as a cast; refused if the soundings do not determine it")
    add_file(profile, "--cast", metavar="CAST",
             help="start and prior mean of the water; default: the cast of the first line")
    profile.add_argument("--nodes", type=whole, metavar="N",
                         help="steps from the head down to the deepest sounding; default: 12")
    profile.add_argument("--cell", type=number, metavar="M",
                         help="distance of the bed's nodes; default: by the density of soundings")
    profile.add_argument("--under-way", action="store_true", default=None,
                         help="positions include the vessel's way between transmit and receive, as in scenes")
    fit.set_defaults(run=_fit, behind_options="inputs")


def _check(arguments):
    path = scenes.find(arguments.scene)
    if arguments.output is not None:
        check_output(arguments.output, (".csv", ".nc"))
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.gradients import gradient_check

    set_up(arguments.threads)
    scene = load_file(path, **parameters(arguments))
    with Progress("parameters", "checking") as progress:
        checked = gradient_check(scene, arguments.keys or None, sensor=arguments.sensor, seed=arguments.seed,
                                 directions=arguments.directions, tolerance=arguments.tolerance, progress=progress)
    print(checked.text(), flush=True)
    if arguments.output is not None:
        _write_table(checked.to_dataset(), arguments.output)
        announce(arguments.output)
    for row in checked.wrong:
        warn(f"the gradient of {row.name} is {row.verdict}: do not fit by it")
    if checked.undecided and not arguments.allow_undecided:
        names = ", ".join(row.name for row in checked.undecided)
        warn(f"differences could not decide on {names}; take more rays, such as -D rays=100000, or --allow-undecided")
        return 1
    return 1 if checked.wrong else 0


def _write_table(table, path):
    from mitsonar.device.files import replacing
    from mitsonar.io.records import netcdf

    if path.lower().endswith(".nc"):
        netcdf.write(table, path)
        return
    with replacing(path) as temporary:
        table.to_dataframe().to_csv(temporary, index=False, lineterminator="\n")


def _fit(arguments):
    from mitsonar.device.files import replacing

    if arguments.output is None and arguments.profile is None:
        raise ValueError("fit writes its answer to a file; give -o OUT.nc")
    for path, suffix in ((arguments.output, ".nc"), (arguments.profile, ".csv")):
        if path is not None:
            check_output(path, (suffix,))
    check_picture(arguments.picture)
    for path in filter(None, (arguments.output, arguments.profile, arguments.picture)):
        if os.path.exists(path) and any(os.path.exists(source) and os.path.samefile(path, source)
                                        for source in (arguments.what, *arguments.inputs)):
            raise ValueError(f"{path} is one of the inputs; give another name")
    from mitsonar.inversion.problems import solve
    from mitsonar.io.records import netcdf

    options = {name: value for name in OPTIONS if (value := getattr(arguments, name)) is not None}
    if arguments.parameters:
        options["parameters"] = parameters(arguments)
    set_up(arguments.threads)
    if arguments.state is not None:
        leave_if_interrupted(arguments.state)
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

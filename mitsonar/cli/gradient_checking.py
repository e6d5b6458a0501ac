"""The command that compares gradients with differences: gradient-check."""
import os
from typing import TYPE_CHECKING

from mitsonar.io.scene_files import scenes

from .arguments import Commands, add_scene, number, parameters, set_up, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import announce, warn

if TYPE_CHECKING:
    import xarray as xr

TABLES = (".csv", ".nc")


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    check = commands.add_parser("gradient-check", help="compare gradients of a scene's parameters, forward and "
                                                        "backward, with differences, each parameter alone")
    add_scene(check)
    check.add_argument("keys", metavar="KEY", nargs="*",
                       help="a parameter, as mi.traverse names it, such as bed.vertex_positions; default: all that "
                            "gradients can be of")
    check.add_argument("--sensor", default=0, metavar="ID", help="which of the scene's sonars: its id; default: the "
                                                                 "first")
    check.add_argument("--directions", type=whole, default=3, metavar="N",
                       help="smooth random directions of each part of a parameter; default: 3")
    check.add_argument("--tolerance", type=number, default=0.01, metavar="SHARE",
                       help="error up to which a gradient is right; default: 0.01")
    check.add_argument("--allow-undecided", action="store_true",
                       help="end with 0 where differences could not decide; without it that ends with 1, as what is "
                            "off does")
    complete_with(check.add_argument("-o", "--output", metavar="OUT.csv|nc", help="write the table there, too"), FILES)
    check.set_defaults(run=_check, behind_options="keys")


def _check(arguments):
    from mitsonar.device.files import check_writable

    path = scenes.find(arguments.scene)
    if arguments.output is not None:
        if os.path.splitext(arguments.output)[1].lower() not in TABLES:
            raise ValueError(f"cannot write {arguments.output}: its name must end in .csv or .nc")
        check_writable(arguments.output)
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.gradients import gradient_check

    set_up(arguments.threads)
    scene = load_file(path, **parameters(arguments))
    with Progress("parameters", "checking") as progress:
        found = gradient_check(scene, arguments.keys or None, sensor=arguments.sensor, seed=arguments.seed,
                               directions=arguments.directions, tolerance=arguments.tolerance, progress=progress)
    print(found.text(), flush=True)
    if arguments.output is not None:
        _write(found.to_dataset(), arguments.output)
        announce(arguments.output)
    for row in found.wrong:
        warn(f"the gradient of {row.name} is {row.verdict}: do not fit by it")
    if found.undecided and not arguments.allow_undecided:
        names = ", ".join(row.name for row in found.undecided)
        warn(f"differences could not decide on {names}; take more rays, such as -D rays=100000, or --allow-undecided")
        return 1
    return 1 if found.wrong else 0


def _write(table: "xr.Dataset", path: str) -> None:
    from mitsonar.device.files import replacing
    from mitsonar.io.records import netcdf

    if os.path.splitext(path)[1].lower() == ".nc":
        netcdf.write(table, path)
        return
    with replacing(path) as temporary:
        table.to_dataframe().to_csv(temporary, index=False, lineterminator="\n")

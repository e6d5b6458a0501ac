"""The command plan: lines of a multibeam survey, their coverage and errors."""
import os
from typing import TYPE_CHECKING

from .arguments import Commands, check_picture, number, whole
from .completion import add_file
from .words import announce, warn

if TYPE_CHECKING:
    from mitsonar.device.earth import Frame
    from mitsonar.planning.areas import Corners
    from mitsonar.planning.bed import PlannedBed
    from mitsonar.water.profile import SoundSpeedProfile

LAYER = 10.0                       # [m], default thickness of the layer of --cast-error


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    plan = commands.add_parser("plan", help="plan the lines of a multibeam survey: time, coverage, errors of the cast")
    add_file(plan, "bathymetry", metavar="BATHYMETRY", nargs="?",
             help="GeoTIFF, BAG, netCDF, ESRI ASCII, or text of x, y, z; or give --depth")
    add_file(plan, "-o", "--output", metavar="OUT.csv|geojson|gpx", action="append", default=[],
             help="file of the lines; repeatable")
    bed = plan.add_argument_group("the bed and the area")
    bed.add_argument("--depth", type=number, metavar="M", help="depth of a level bed, in place of a bathymetry")
    bed.add_argument("--area", metavar="CORNERS|FILE",
                     help='"x y, x y, x y" [m], "37.75N 122.38W, ...", or GeoJSON; default: the whole bathymetry')
    bed.add_argument("--crs", metavar="NAME", help='coordinate system of a bathymetry that names none: "EPSG:32632"')
    bed.add_argument("--vertical", default="auto", choices=("auto", "depth", "elevation"),
                     help="meaning of the bathymetry's numbers; default: by their sign")
    bed.add_argument("--resolution", type=number, metavar="M", help="cell of the bathymetry; default: its own")
    bed.add_argument("--least-depth", type=number, metavar="M",
                     help="leave out shoaler bed; default: a metre below the sonar's head")
    sonar = plan.add_argument_group("the sonar and the water")
    add_file(sonar, "--sonar", metavar="PRESET|SCENE", shipped=True,
             help="a preset of `multibeam`, or a scene with one; the options below override it")
    sonar.add_argument("--swath", type=number, metavar="DEG", help="angle between the outermost beams; default: 130")
    sonar.add_argument("--beams", type=whole, metavar="N", help="soundings of a ping; default: 256")
    sonar.add_argument("--beam-spacing", choices=("angle", "distance"),
                       help="quantity in which soundings are evenly spaced; default: distance")
    sonar.add_argument("--beam-width", type=number, metavar="DEG",
                       help="width of the transmit beam along the track; default: that of --sonar")
    sonar.add_argument("--rate", type=number, metavar="HZ",
                       help="highest ping rate; default: as the travel times allow")
    sonar.add_argument("--head-depth", type=number, metavar="M",
                       help="depth of the sonar below the surface; default: 0")
    sonar.add_argument("--max-range", type=number, metavar="M", help="largest slant range; default: none")
    add_file(sonar, "--cast", metavar="FILE", help="sound speed over depth; default: 1500 m/s")
    lines = plan.add_argument_group("the lines")
    lines.add_argument("--spacing", type=number, metavar="M", help="distance between lines; default: by --overlap")
    lines.add_argument("--overlap", type=number, metavar="PERCENT", help="overlap of neighbouring swaths; default: 10")
    lines.add_argument("--swath-at", choices=("line", "shoalest", "mean"),
                       help="swath for --overlap: each line's own (default), or that of one depth for all lines")
    lines.add_argument("--heading", metavar="DEG|best", default="best",
                       help="heading of the lines, clockwise from north; default: best, along the contours")
    lines.add_argument("--speed", type=number, default=5.0, metavar="KNOTS", help="speed of the ship; default: 5")
    lines.add_argument("--run-in", type=number, default=50.0, metavar="M",
                       help="distance before each line; default: 50")
    lines.add_argument("--turn-radius", type=number, default=50.0, metavar="M",
                       help="radius of turns between lines; default: 50; 0: no turns")
    lines.add_argument("--cross", type=number, metavar="N",
                       help="add cross lines, N spacings of the lines apart; default: none")
    lines.add_argument("--useful-swath", action="store_true",
                       help="narrow the swath to the beams whose uncertainty is within --order")
    budget = plan.add_argument_group("uncertainty")
    budget.add_argument("--accuracy", action="append", default=[], metavar="NAME=VALUE",
                        help="standard deviation of a sensor, such as tide=0.1, position=0.5 or roll_deg=0.02; "
                             "repeatable")
    errors = plan.add_argument_group("a wrong cast")
    errors.add_argument("--cast-error", type=number, metavar="M/S", help="error of the surface layer's sound speed")
    errors.add_argument("--layer", type=number, metavar="M", help=f"thickness of that layer; default: {LAYER:g}")
    add_file(errors, "--other-cast", metavar="FILE", help="cast that reduces the soundings instead of the true one")
    errors.add_argument("--order", default="1a", metavar="ORDER",
                        help="order of IHO S-44 to compare with: exclusive, special, 1a (default), 1b or 2")
    plan.add_argument("--picture", metavar="OUT.png", help="draw a map: depths, lines, swaths, gaps in red")
    plan.add_argument("--scene", metavar="OUT.xml", help="write a scene of `multibeam` that sails the lines")
    plan.add_argument("--sweep", metavar="OUT.toml", help="write a plan of `sweep` that sounds every line of --scene")
    plan.add_argument("--json", metavar="OUT.json", help="write all numbers")
    plan.set_defaults(run=_plan)


def _plan(arguments):
    from mitsonar.hydrography.survey_orders import survey_order
    from mitsonar.planning import line_files, scene_of_plan, summary
    from mitsonar.planning.area import polygon
    from mitsonar.planning.areas import read
    from mitsonar.planning.plan import plan
    from mitsonar.planning.uncertainty.error_budget import accuracies_of

    order, accuracies = survey_order(arguments.order), accuracies_of(arguments.accuracy)
    outputs = _checked_outputs(arguments)
    layout = _layout(arguments)
    corners = None if arguments.area is None else read(arguments.area)
    sonar, profile, cast = _sonar_and_water(arguments)
    used = _used(arguments, profile)
    bed, frame = _bed(arguments, corners)
    for path in arguments.output:
        line_files.check(path, frame)
    planned = plan(bed, profile, sonar, layout, area=None if corners is None else polygon(corners.placed(frame)),
                   used=used, order=order, accuracies=accuracies)
    numbers = summary.summary(planned, frame)
    for path in arguments.output:
        line_files.write(planned, path, frame)
    if arguments.scene:
        scene_of_plan.write(planned, arguments.scene, frame, scene_of_plan.BedFile(
            bathymetry=arguments.bathymetry, vertical=arguments.vertical, resolution=arguments.resolution,
            crs=arguments.crs, cast=cast))
    if arguments.sweep:
        scene_of_plan.write_sweep(planned, arguments.sweep, arguments.scene)
    if arguments.json:
        summary.write(numbers, arguments.json)
    if arguments.picture:
        from mitsonar.plots.sheets.survey_plan import survey_plan

        name = f"a level bed {arguments.depth:g} m deep" if arguments.bathymetry is None else os.path.basename(
            arguments.bathymetry)
        survey_plan(planned, arguments.picture, frame, title=f"Survey plan: {name}",
                    subtitle=summary.subtitle(numbers))
    for doubt in _doubts(planned, numbers, None if cast is None else float(profile.depth[-1])):
        warn(doubt)
    print(summary.report(numbers))
    for path in outputs:
        announce(path)


def _checked_outputs(arguments):
    """Return the names of all outputs, checked before the work begins."""
    from mitsonar.device import files
    from mitsonar.planning import line_files, scene_of_plan

    for path in arguments.output:
        line_files.check(path)
    check_picture(arguments.picture or None)
    if arguments.scene:
        scene_of_plan.check(arguments.scene)
    if arguments.sweep:
        if not arguments.scene:
            raise ValueError(f"--sweep {arguments.sweep} sounds the lines of a scene; give --scene OUT.xml too.")
        scene_of_plan.check(arguments.sweep, ".toml")
    outputs = [*arguments.output, *filter(None, (arguments.scene, arguments.sweep, arguments.json, arguments.picture))]
    targets = [files.check_writable(path) for path in outputs]
    for index, target in enumerate(targets):
        if target in targets[:index]:
            raise ValueError(f"{outputs[index]} is the name of two outputs; give each output its own name.")
    return outputs


def _layout(arguments):
    from mitsonar.planning.plan import Layout
    from mitsonar.units import KNOT, radians_from_deg

    if arguments.spacing is not None and (arguments.overlap is not None or arguments.swath_at is not None):
        raise ValueError("--spacing is given beside --overlap or --swath-at, which decide it; leave one out.")
    heading = None
    if arguments.heading != "best":
        try:
            heading = float(radians_from_deg(float(arguments.heading)))
        except ValueError:
            raise ValueError(f"--heading is {arguments.heading!r}; give degrees from north, or best.") from None
    overlap = 10.0 if arguments.overlap is None else arguments.overlap
    return Layout(spacing=arguments.spacing, overlap=overlap / 100, swath_at=arguments.swath_at or "line",
                  heading=heading, speed=arguments.speed * KNOT, run_in=arguments.run_in,
                  turn_radius=arguments.turn_radius, least_depth=arguments.least_depth,
                  useful=arguments.useful_swath, cross=arguments.cross)


def _sonar_and_water(arguments):
    """Return the sonar, the profile, and the file of its cast."""
    from mitsonar.io import casts
    from mitsonar.planning.coverage import SwathSonar
    from mitsonar.planning.sonar import planned_sonar
    from mitsonar.units import radians_from_deg
    from mitsonar.water.profile import SoundSpeedProfile

    known = {} if arguments.sonar is None else planned_sonar(arguments.sonar)
    given = {"swath_deg": arguments.swath, "beams": arguments.beams, "even": arguments.beam_spacing,
             "beam_width_deg": arguments.beam_width,
             "rate": arguments.rate, "head_depth": arguments.head_depth, "max_range": arguments.max_range}
    asked = {"swath_deg": 130.0, "even": "distance"} | known | {name: value for name, value in given.items()
                                                                if value is not None}
    known_cast = asked.pop("cast", None)
    cast = arguments.cast or known_cast
    width = asked.pop("beam_width_deg", None)
    sonar = SwathSonar(swath=float(radians_from_deg(asked.pop("swath_deg"))),
                       beam_width=None if width is None else float(radians_from_deg(width)), **asked)
    return sonar, SoundSpeedProfile.constant(1500.0) if cast is None else casts.read(cast).profile, cast


def _used(arguments, profile: "SoundSpeedProfile") -> "SoundSpeedProfile | None":
    """Return the profile that reduces the soundings, if it is not the true one."""
    from mitsonar.io import casts
    from mitsonar.planning.uncertainty.cast_errors import surface_layer_error

    if arguments.cast_error is None:
        if arguments.layer is not None:
            raise ValueError("--layer is the thickness of the layer of --cast-error; give both.")
        return None if arguments.other_cast is None else casts.read(arguments.other_cast).profile
    if arguments.other_cast is not None:
        raise ValueError("--cast-error and --other-cast are both given; leave one out.")
    if abs(arguments.cast_error) > 1e4:
        raise ValueError(f"--cast-error is {arguments.cast_error:g} m/s; give a smaller error of the cast.")
    layer = LAYER if arguments.layer is None else arguments.layer
    if not 0 < layer < 1e5:
        raise ValueError(f"--layer is {layer:g} m; give a depth above 0.")
    return surface_layer_error(profile, arguments.cast_error, layer)


def _bed(arguments, corners: "Corners | None") -> "tuple[PlannedBed, Frame]":
    """Return the bed, and the frame of its coordinates."""
    from mitsonar.device.earth import Frame, metric_system
    from mitsonar.io.grids import bathymetry, rasters
    from mitsonar.planning.areas import Corners
    from mitsonar.planning.bed import bed_of, flat_bed

    if (arguments.bathymetry is None) == (arguments.depth is None):
        raise ValueError("a plan needs a bed: give a BATHYMETRY, or --depth M for a level one, and not both.")
    if arguments.bathymetry is not None:
        grid = bathymetry.read(arguments.bathymetry, crs=arguments.crs, vertical=arguments.vertical,
                               resolution=arguments.resolution)
        return bed_of(grid.x, grid.y, grid.heights), Frame(crs=grid.crs, origin=grid.local_origin)
    if corners is None:
        raise ValueError("a level bed has no extent of its own; give --area too.")
    if not 0 < arguments.depth < 12000:
        raise ValueError(f"--depth is {arguments.depth:g} m; give more than 0 and less than 12000.")
    if arguments.resolution is not None or arguments.vertical != "auto":
        raise ValueError("--resolution and --vertical apply to a bathymetry only; leave them out with --depth.")
    crs = corners.utm() if arguments.crs is None else rasters.name_of(rasters.crs_of(arguments.crs))
    if arguments.crs is not None:
        metric_system(crs)
    frame = Frame(crs=crs)
    west, south, east, north = Corners(rings=tuple(corners.placed(frame)), crs="").bounds
    if not (west < east and south < north):
        raise ValueError("the area has no extent: its corners lie on a line; draw a polygon.")
    middle = round(0.5 * (west + east)), round(0.5 * (south + north))
    bed = flat_bed(arguments.depth, west - middle[0], south - middle[1], east - middle[0], north - middle[1])
    return bed, Frame(crs=frame.crs, origin=(float(middle[0]), float(middle[1])))


def _doubts(planned, numbers, deepest_sample):
    """Yield warnings about the plan."""
    from mitsonar.planning.uncertainty.error_budget import HITS
    from mitsonar.units import KNOT

    _, _, deepest = planned.depths
    if deepest_sample is not None and deepest_sample < deepest:
        yield (f"the cast ends at {deepest_sample:.4g} m and the bed lies down to {deepest:.4g} m; sound speed is "
               "taken as constant below the cast")
    unknown = numbers["area"]["without_depth_percent"]
    if unknown >= 0.05:
        yield f"{unknown:.1f} % of the area has no depth; it is not counted in the coverage"
    if planned.shoal >= 0.0005:
        yield f"{100 * planned.shoal:.1f} % of the area is shoaler than {planned.least_depth:.4g} m, and is left out"
    along, speed = numbers["along_track"], planned.layout.speed
    if along["gapless_speed"] is not None and speed > along["gapless_speed"]:
        yield (f"at {speed / KNOT:.3g} knots pings leave gaps along the track straight below; sail at "
               f"{along['gapless_speed'] / KNOT:.3g} knots or less")
    if along["feature_speed"] is not None and speed > along["feature_speed"]:
        yield (f"at {speed / KNOT:.3g} knots fewer than {HITS} pings meet a feature of {along['feature']:.2g} m, the "
               f"least that order {numbers['order']} asks for; sail at {along['feature_speed'] / KNOT:.3g} knots or "
               "less")
    aground = [line.number for line in planned.lines if line.track.depth.min() <= planned.sonar.head_depth]
    if aground:
        names = f"{', '.join(map(str, aground[:8]))}{' ...' if len(aground) > 8 else ''}"
        yield f"line {names} leads over bed no deeper than the sonar's head, {planned.sonar.head_depth:g} m"

"""The commands that render: render, signals, demo."""
import os

from mitsonar.io.scene_files import scenes

from .arguments import Commands, add_scene, parameters, set_up, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import announce, warn

EVERY = "all"                      # of the sensors
DEMO = {"rays": 60_000}            # a ping: 32 a bin, whose noise is a fourteenth of the speckle's


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    render = commands.add_parser("render", help="render a scene to an EXR")
    add_scene(render)
    complete_with(render.add_argument("-o", "--output", required=True, metavar="OUT.exr"), FILES)
    preview = render.add_argument("--preview", metavar="OUT.png", help="also write a picture with axes and scale")
    complete_with(preview, FILES)
    render.add_argument("--each-ping", action="store_true",
                        help="of a fan of beams: a file a ping, OUT_0000.exr and so on, whatever their number")
    _add_sensor(render, "or all, each to a file of its own: OUT_ID.exr; ")
    render.set_defaults(run=_render)

    signals = commands.add_parser("signals", help="write what the elements of an array hear, or the raw echoes of "
                                                   "a synthetic aperture, to a netCDF file")
    add_scene(signals)
    complete_with(signals.add_argument("-o", "--output", required=True, metavar="OUT.nc"), FILES)
    signals.add_argument("--ping", type=whole, action="append", metavar="N",
                         help="which ping; repeatable; default: all")
    signals.add_argument("--response", action="store_true",
                         help="the impulse response of every pair of elements instead")
    signals.add_argument("--kernel", default="band_limited", help="band_limited (default), peterson or nearest")
    signals.add_argument("--return-path", default="vector", help="vector (default), paper or eigenray")
    signals.add_argument("--path", action="append", metavar="NAME",
                         help="only echoes along this path, such as b, bs or v; may be repeated; default: all")
    complete_with(signals.add_argument("--scatterers", metavar="OUT.nc",
                                       help="of a synthetic aperture: write the scatterers of its echoes, too"),
                  FILES)
    _add_sensor(signals)
    signals.set_defaults(run=_signals)

    demo = commands.add_parser("demo", help="render the demo scene into demo.exr and demo.png here")
    demo.add_argument("--seed", type=whole, default=0, metavar="N")
    demo.set_defaults(run=_demo)


def _render(arguments):
    if arguments.each_ping:
        _render_pings(arguments)
        return
    _render_to(scenes.find(arguments.scene), parameters(arguments), arguments.seed, arguments.output,
               arguments.preview, arguments.threads, arguments.sensor)


def _signals(arguments):
    from mitsonar.device import files
    from mitsonar.io.records import signals as netcdf

    path = scenes.find(arguments.scene)
    files.check_writable(arguments.output)
    if os.path.splitext(arguments.output)[1].lower() != ".nc":
        raise ValueError(f"cannot write {arguments.output}: its name must end in .nc")
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.images import element_signals, impulse_response, pings

    from .strip_signals import is_strip, write_strip

    set_up(arguments.threads)
    scene = load_file(path, **parameters(arguments))
    if is_strip(scene, arguments.sensor):
        write_strip(arguments, scene)
        return
    if arguments.scatterers is not None:
        raise ValueError("--scatterers is of a synthetic aperture, and this sensor is none; leave it out.")
    compute = impulse_response if arguments.response else element_signals
    with Progress() as progress:
        which = arguments.sensor
        recorded = compute(scene, arguments.ping or range(pings(scene, sensor=which)), kernel=arguments.kernel,
                           return_path=arguments.return_path, seed=arguments.seed, sensor=which,
                           paths=arguments.path, progress=progress, say=warn)
    netcdf.write(arguments.output, recorded)
    announce(arguments.output)


def _demo(arguments):
    _render_to(scenes.find("sidescan_targets"), DEMO, arguments.seed, "demo.exr", "demo.png", None)


def _render_to(path, values, seed, output, preview, threads, sensor=0):
    _check_outputs(output, preview)
    from mitsonar import load_file, render
    from mitsonar.io.records import exr

    set_up(threads)
    scene = load_file(path, **values)
    for which, suffix in _sensors(scene, sensor):
        image, picture = _with_suffix(output, suffix), preview and _with_suffix(preview, suffix)
        with Progress() as progress:
            dataset = render(scene, seed=seed, sensor=which, progress=progress, say=warn)
        exr.write(dataset, image)
        announce(image)
        if picture is not None:
            from mitsonar import plots

            plots.preview(dataset, picture)
            announce(picture)


def _sensors(scene, asked):
    """The sensors that are asked for, by number or id, each with what its file's name has in addition."""
    ids = [one.id() for one in scene.sensors()]
    if asked == EVERY and EVERY not in ids:
        return [(number, f"_{name}".replace(os.sep, "_")) for number, name in enumerate(ids)]
    if asked == 0 and len(ids) > 1:
        warn(f"the scene has {len(ids)} sonars, and {ids[0]} is rendered; --sensor all renders "
             f"{'both' if len(ids) == 2 else 'each'} to a file of its own")
    return [(asked, "")]


def _with_suffix(path, suffix):
    base, ending = os.path.splitext(path)
    return f"{base}{suffix}{ending}"


def _add_sensor(command, more=""):
    command.add_argument("--sensor", default=0, metavar="ID",
                         help=f"which of the scene's sonars: its id, {more}default: the first")


def _render_pings(arguments):
    if arguments.preview is not None:
        raise ValueError("--preview and --each-ping are both given; draw the pings by `mitsonar plot` or `mitsonar "
                         "video`, or leave one of them out.")
    _check_outputs(arguments.output, None)
    from mitsonar import frames, load_file
    from mitsonar.io.records import exr
    from mitsonar.verbs.images import pings

    set_up(arguments.threads)
    scene = load_file(scenes.find(arguments.scene), **parameters(arguments))
    if arguments.sensor == EVERY:
        raise ValueError("--sensor all and --each-ping are both given; name one sonar, or leave one of them out.")
    images = frames(scene, seed=arguments.seed, sensor=arguments.sensor)
    base = os.path.splitext(arguments.output)[0]
    with Progress() as progress:
        total = pings(scene, sensor=arguments.sensor)
        for number, image in enumerate(images):
            exr.write(image, f"{base}_{number:04d}.exr")
            progress(number + 1, total)
    announce(f"{base}_0000.exr to {base}_{total - 1:04d}.exr" if total > 1 else f"{base}_0000.exr")


def _check_outputs(output, preview):
    """An hour of rendering must not end in a missing folder."""
    from mitsonar.device.files import check_writable

    try:
        f"{output}{preview}".encode()
    except UnicodeEncodeError:
        raise ValueError("cannot write a file whose name is not UTF-8; give another name") from None
    check_writable(output)
    if os.path.splitext(output)[1].lower() != ".exr":
        raise ValueError(f"cannot write {output}: its name must end in .exr; pictures are made by --preview")
    if preview is not None:
        from mitsonar.plots.canvas import file_format

        file_format(preview)
        check_writable(preview)

"""The commands that show and check results: plot, video, view, compare, published, validate."""
import contextlib
import importlib
import os
import sys

from .arguments import (
    Commands,
    add_gain,
    add_parameters,
    check_output,
    check_picture,
    gain,
    number,
    parameters,
    set_up,
    whole,
)
from .completion import add_file
from .progress import Progress
from .words import announce


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    plot = commands.add_parser("plot", help="draw an image, a line of soundings or a fit's answer")
    add_file(plot, "image", metavar="IN.exr|nc|kmall|all|gsf|s7k|xtf|hsx|jsf|sdf|raw",
             help="an image, a line of soundings, a recorded sidescan, an echo sounder's .raw file, a comparison, or a "
                  "fit's answer")
    plot.add_argument("--what", metavar="VIEW",
                      help="view of an image: waterfall (default), objects, ping, mean, labels, class, share, hidden, "
                           "shadow, layover, depth or rays, of an interferometric sidescan also phase, coherence, "
                           "angle, measured_depth or depth_error; of soundings: overview (default), column, curtain, "
                           "swath, error, error_detection, error_refraction, error_motion, backscatter, smile, rays, "
                           "quality or motion; of a focused image: image (default), phase, coherence, height, labels, "
                           "shadow or depth; of a fit's answer: fit")
    plot.add_argument("-o", "--output", metavar="OUT.png", help="picture; default: IN_VIEW.png")
    plot.add_argument("--ping", type=whole, metavar="N",
                      help="number of the ping, from 0; default: the middle one, of a fan the first")
    add_gain(plot, "recorder")
    plot.add_argument("--bank", type=whole, metavar="N",
                      help="bank of receivers of a focused image; default: the first")
    plot.set_defaults(run=_plot)

    video = commands.add_parser("video", help="draw the pings of fans, or the water column of a line of soundings, as "
                                              "a GIF, an MP4 or PNG files")
    add_file(video, "records", metavar="IN.exr|nc|kmall|all|s7k", nargs="+",
             help="images of the same beams, in their order, or one line of soundings")
    add_file(video, "output", metavar="OUT", help="OUT.gif, OUT.mp4, or a folder for PNG files")
    video.add_argument("--fps", type=number, metavar="N",
                       help="frames a second; default: the ping rate, between 1 and 30")
    video.add_argument("--width", type=whole, metavar="PIXELS",
                       help="largest width of the frames, for small files; default: about 1100")
    add_gain(video, "seabed")
    video.set_defaults(run=_video)
    for command in (plot, video):
        command.add_argument("--colours", default="copper", choices=("copper", "grey"),
                             help="colours of waterfalls, fans, water columns and focused images; default: copper")

    view = commands.add_parser("view", help="show scenes and records in the browser, with a time line")
    add_file(view, "shown", metavar="SCENE|RECORD", nargs="+", shipped=True,
             help="scenes (.xml, or names of those that come with mitsonar), images, or lines of soundings")
    add_file(view, "--save", metavar="RUN.rrd", help="write the page's contents to a file of rerun instead")
    add_gain(view, "recorder", "display gain over range of images")
    view.add_argument("--cell", type=number, metavar="M",
                      help="side of a cell of frames of fans; default: a bin, with at most 640 cells a side")
    add_parameters(view)
    view.add_argument("--sensor", default=0, metavar="ID", help="id of one of the scenes' sonars; default: the first")
    view.add_argument("--port", type=whole, default=0, metavar="N", help="port of the page; default: any that is free")
    view.add_argument("--no-browser", action="store_true", help="print the page's address only")
    view.set_defaults(run=_view)

    compare = commands.add_parser("compare", help="compare a real record with a simulated one of the same line")
    add_file(compare, "real", metavar="REAL",
             help="line of soundings (.all, .kmall, .gsf, .s7k, .xtf, .hsx, .nc), or a recorded sidescan (.xtf, .jsf, "
                  ".sdf)")
    add_file(compare, "simulated", metavar="SIMULATED",
             help="soundings or image of a scene that `like` made, or the scene itself (.xml), which is sounded or "
                  "rendered first")
    add_file(compare, "-o", "--output", metavar="OUT.nc", help="terms of the comparison; default: print them alone")
    add_file(compare, "--sheet", metavar="OUT.png|pdf|svg", help="sheet of all terms")
    compare.add_argument("--seed", type=whole, default=0, metavar="N", help="random seed of a scene; default: 0")
    compare.set_defaults(run=_compare)

    published = commands.add_parser("published", help="compute a table or figure of the published method again")
    published.add_argument("result", metavar="RESULT", help="table_1, effective_speed, figure_2 or figure_3")
    published.add_argument("-o", "--output", metavar="OUT.png|OUT.csv",
                           help="figure or numbers; default: print the result")
    published.set_defaults(run=_published)

    validate = commands.add_parser("validate", help="compare with closed forms, published numbers and exact eigenrays")
    validate.add_argument("-o", "--output", metavar="FOLDER", help="folder for report.md and pictures; default: none")
    validate.add_argument("--only", nargs="+", metavar="NAME", help="names of comparisons; default: all")
    validate.add_argument("--quick", action="store_true", help="fewer rays and sediments: a minute in place of several")
    validate.set_defaults(run=_validate)


def _plot(arguments):
    from mitsonar import plots

    with _opened(arguments.image) as dataset:
        if "parameters" in dataset.attrs and "predicted" in dataset:     # as Fit.to_dataset makes them
            return _plot_fit(arguments, dataset)
        if dataset.attrs.get("kind") == "comparison":
            return _plot_comparison(arguments, dataset)
        what = arguments.what or plots.usual_plot(dataset)
        output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_{what}.png"
        plots.plot(dataset, what, output, tvg=gain(arguments), ping=arguments.ping, colours=arguments.colours,
                   bank=arguments.bank)
    announce(output)


def _plot_fit(arguments, answer):
    """Draw a fit's answer."""
    from mitsonar.plots.sheets.fit_sheet import fit_figure

    _plot_only(arguments, "fit", "the answer of a fit", lambda: fit_figure(answer))


def _plot_comparison(arguments, found):
    """Draw a comparison."""
    from mitsonar.plots.sheets.comparison_sheet import comparison_figure

    _plot_only(arguments, "comparison", "a comparison", lambda: comparison_figure(found))


def _plot_only(arguments, what, holds, figure):
    """Draw the only view of a record, which has no options."""
    from mitsonar.plots.canvas import save

    asked = {"--ping": arguments.ping is not None, "--bank": arguments.bank is not None,
             "--tvg": arguments.tvg != "recorder", "--colours": arguments.colours != "copper"}
    if arguments.what not in (None, what):
        raise ValueError(f"{arguments.image} holds {holds}, whose only plot is {what}, and not {arguments.what!r}; "
                         "leave --what out.")
    if any(asked.values()):
        needless = ", ".join(option for option, given in asked.items() if given)
        raise ValueError(f"the picture of {holds.removeprefix('the answer of ')} has no {needless}; leave that out.")
    output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_{what}.png"
    save(figure(), output)
    announce(output)


@contextlib.contextmanager
def _opened(path):
    """Open an EXR, a line of an instrument, or a netCDF file, whose water column may be larger than memory."""
    from mitsonar.io.reading import is_netcdf
    from mitsonar.io.records import netcdf

    if not is_netcdf(path):
        yield _instruments_line(path) or _image(path)
        return
    import xarray as xr

    with netcdf.opened(path) as record:
        if not isinstance(record, xr.Dataset):
            raise ValueError(f"{path} holds signals, and plots show images and soundings; beamform the signals first.")
        if "signal" in record:
            raise ValueError(f"{path} holds raw echoes, and plots are of images and soundings; focus them by `mitsonar "
                             "focus` first.")
        yield record


def _image(path):
    """Return the image of an EXR."""
    from mitsonar.device.files import EXR
    from mitsonar.io.records import exr

    if os.path.isfile(path):
        with open(path, "rb") as stream:
            if (head := stream.read(len(EXR))) and head != EXR:
                raise ValueError(f"cannot read {path}: it is no EXR, no netCDF, and no line of a sounder or a "
                                 "sidescan; give one of these.")
    return exr.read(path)


def _instruments_line(path):
    """Return the soundings, sidescan or echogram of a file of an instrument or survey software, else None."""
    from mitsonar.device.files import EXR

    if not os.path.isfile(path):
        return None
    with open(path, "rb") as stream:
        if stream.read(8).startswith(EXR):             # an EXR needs none of the imports below
            return None
    from mitsonar.io.reading import recorded

    return recorded(path)


def _video(arguments):
    from mitsonar import plots

    with Progress("records", "drawing") as progress:
        records = arguments.records
        if len(records) == 1:
            records = _instruments_line(records[0]) or records[0]
        plots.video(records, arguments.output, fps=arguments.fps, colours=arguments.colours,
                    tvg=gain(arguments), width=arguments.width, progress=progress)
    announce(arguments.output)


def _view(arguments):
    from mitsonar.viewing.viewer import ViewOptions, opened

    set_up(None)
    if arguments.save is not None:
        check_output(arguments.save, (".rrd",))
        if arguments.port or arguments.no_browser:
            raise ValueError("--port and --no-browser are for a page, and --save writes a file; leave them out.")
    options = ViewOptions(tvg=gain(arguments), cell=arguments.cell, sensor=arguments.sensor,
                          parameters=parameters(arguments))
    page = opened(arguments.shown, options, save=arguments.save, port=arguments.port)
    if page is None:
        announce(arguments.save)
        return
    try:
        announce(page.url)
        print("mitsonar: the page is served on this machine alone; end it by Ctrl-C", file=sys.stderr)
        if not arguments.no_browser:
            page.open()
        page.wait()
    finally:
        page.close()


def _compare(arguments):
    from mitsonar.comparison import compare
    from mitsonar.io.records import netcdf

    if arguments.output is not None:
        check_output(arguments.output, (".nc",))
    check_picture(arguments.sheet)
    if arguments.simulated.lower().endswith(".xml"):
        set_up(None)
    found = compare(arguments.real, arguments.simulated, seed=arguments.seed)
    print(found, flush=True)
    if arguments.output is not None:
        netcdf.write(found, arguments.output)
        announce(arguments.output)
    if arguments.sheet is not None:
        from mitsonar.plots.canvas import save
        from mitsonar.plots.sheets.comparison_sheet import comparison_figure

        save(comparison_figure(found), arguments.sheet)
        announce(arguments.sheet)


def _published(arguments):
    set_up(None)
    try:
        published = importlib.import_module("mitsonar.scenes.published")
    except ModuleNotFoundError as error:
        if error.name != "mitsonar.scenes.published":
            raise
        raise ValueError("the published results are computed by scripts of the source checkout, scenes/published, and "
                         "this mitsonar is installed without them; run the command there.") from None
    if arguments.output is None:
        print(published.text(arguments.result), flush=True)
        return
    published.write(arguments.result, arguments.output)
    announce(arguments.output)


def _validate(arguments):
    from mitsonar.validation import validate

    set_up(None)
    holds = validate(arguments.only, quick=arguments.quick, folder=arguments.output,
                     say=lambda text: print(text, flush=True))
    if arguments.output is not None:
        announce(os.path.join(arguments.output, "report.md"))
    return 0 if holds else 1

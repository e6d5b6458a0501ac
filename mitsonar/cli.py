"""The command line: render, plot, doctor, demo. Exit codes: 0 done, 2 for what the user can mend, 130 for Ctrl-C."""
import argparse
import os
import sys
import time
from importlib.resources import files

__all__ = ["main"]

QUIET_SECONDS = 2.0                # progress is shown on anything longer
LINE_SECONDS = 10.0                # where there is no terminal, a line this often


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise ValueError(f"{message}; see {self.prog} --help")


def main(argv=None):
    """Run one command and return its exit code."""
    try:
        arguments = _parser().parse_args(argv)
        return arguments.run(arguments) or 0
    except (ValueError, OSError) as error:
        print(f"mitsonar: {_sentence(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nmitsonar: interrupted, nothing was written", file=sys.stderr)
        return 130


def _parser():
    parser = _Parser(prog="mitsonar", description="Render sonar images of Mitsuba scenes.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    render = commands.add_parser("render", help="render a scene to an EXR")
    render.add_argument("scene", help="Mitsuba XML file, or the name of a scene that comes with mitsonar")
    render.add_argument("-o", "--output", required=True, metavar="OUT.exr")
    render.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                        help="value for a $parameter of the scene; repeatable")
    render.add_argument("--seed", type=int, default=0)
    render.add_argument("--preview", metavar="OUT.png", help="also write a picture with axes and scale")
    render.add_argument("--threads", type=int, metavar="N", help="worker threads, at least 2; default: one per core")
    render.set_defaults(run=_render)

    plot = commands.add_parser("plot", help="draw what an EXR of mitsonar holds")
    plot.add_argument("image", metavar="IN.exr")
    plot.add_argument("--what", default="waterfall", metavar="VIEW",
                      help="waterfall (default), ping, mean, labels, depth, shadow or rays")
    plot.add_argument("-o", "--output", metavar="OUT.png", help="default: the name of the EXR with the view's name")
    plot.add_argument("--ping", type=int, help="which ping the view `ping` shows; default: the middle one")
    plot.add_argument("--tvg", default="seabed", choices=("seabed", "target", "none"), help="display gain over range")
    plot.set_defaults(run=_plot)

    demo = commands.add_parser("demo", help="render the demo scene into demo.exr and demo.png here")
    demo.add_argument("--seed", type=int, default=0)
    demo.set_defaults(run=_demo)

    commands.add_parser("doctor", help="say what was found on this machine and render one ping").set_defaults(run=_doctor)
    commands.add_parser("test", help="run the project's tests (in a checkout)")
    return parser


def _render(arguments):
    parameters = dict(_key_value(text) for text in arguments.parameters)
    _render_to(_scene_file(arguments.scene), parameters, arguments.seed, arguments.output, arguments.preview,
               arguments.threads)


def _demo(arguments):
    _render_to(_scene_file("sidescan_targets"), {}, arguments.seed, "demo.exr", "demo.png", None)


def _plot(arguments):
    from . import plots
    from .io import exr

    dataset = exr.read(arguments.image)
    output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_{arguments.what}.png"
    tvg = None if arguments.tvg == "none" else arguments.tvg
    plots.plot(dataset, arguments.what, output, tvg=tvg, ping=arguments.ping)
    print(output)


def _doctor(arguments):
    from . import doctor

    def check():
        from . import load_file, render

        render(load_file(_scene_file("sidescan_flat"), pings=1, rays=2000, bins=100))

    return doctor.run(check)


def _render_to(scene_file, parameters, seed, output, preview, threads):
    from .io import exr
    from .io.files import check_writable

    # an hour of rendering must not end in a missing folder
    for path in filter(None, (output, preview)):
        check_writable(path)
    import drjit as dr

    from . import load_file, plots, render

    if threads is not None:
        if threads < 2:
            raise ValueError(f"--threads is {threads}; Mitsuba needs at least 2 (one core is enough for them)")
        dr.set_thread_count(threads)
    scene = load_file(scene_file, **parameters)
    with _Progress() as progress:
        dataset = render(scene, seed=seed, progress=progress)
    exr.write(dataset, output)
    print(output)
    if preview:
        plots.preview(dataset, preview)
        print(preview)


class _Progress:
    """Show pings, pings per second and time left once a run lasts longer than a moment."""

    def __init__(self):
        self.start = self.last_line = time.monotonic()
        self.bar = self.task = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, done, total):
        now = time.monotonic()
        if now - self.start < QUIET_SECONDS:
            return
        if sys.stderr.isatty():
            if self.bar is None:
                self.bar, self.task = self._open(total)
            self.bar.update(self.task, completed=done, rate=f"{done / (now - self.start):.1f} pings/s")
        elif now - self.last_line > LINE_SECONDS:
            self.last_line = now
            rate = done / (now - self.start)
            print(f"{done} of {total} pings, {rate:.1f} pings/s, {(total - done) / rate:.0f} s left", file=sys.stderr)

    @staticmethod
    def _open(total):
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        bar = Progress(TextColumn("rendering"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"),
                       TimeRemainingColumn(), console=Console(stderr=True), transient=True)
        bar.start()
        return bar, bar.add_task("pings", total=total, rate="")


def _key_value(text):
    key, equals, value = text.partition("=")
    if not (equals and key):
        raise ValueError(f"-D takes KEY=VALUE, got {text!r}; for example -D pings=200")
    return key, value


def _scene_file(name):
    if os.path.isfile(name):
        return name
    if os.path.dirname(name) == "":
        shipped = files("mitsonar.scenes") / (name if name.endswith(".xml") else f"{name}.xml")
        if shipped.is_file():
            return str(shipped)
    known = ", ".join(sorted(os.path.splitext(entry.name)[0] for entry in files("mitsonar.scenes").iterdir()
                             if entry.name.endswith(".xml")))
    raise FileNotFoundError(f"scene {name} does not exist; give the path of a Mitsuba XML file or one of: {known}")


def _sentence(error):
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())

"""The command line: render, signals, plot, published, validate, doctor, demo.

Exit codes: 0 done, 1 where `validate` finds too large an error, 2 for what the user can mend, 128 + n where signal n
ended it (130 for Ctrl-C). What is refused or interrupted leaves no file, nor half of one.
"""
import argparse
import datetime
import os
import signal
import sys
import time
import warnings
from importlib.resources import files

from . import __version__

__all__ = ["main"]

QUIET_SECONDS = 2.0                # progress is shown on anything longer
LINE_SECONDS = 10.0                # where there is no terminal, a line this often
MOST_THREADS = 1024


class _Parser(argparse.ArgumentParser):
    def error(self, message):
        raise ValueError(f"{message}; see {self.prog} --help")


def main(argv=None):
    """Run one command and return its exit code."""
    with _Signals() as signals:
        try:
            arguments = _parser().parse_args(argv)
            with warnings.catch_warnings():
                warnings.showwarning = _warn
                return arguments.run(arguments) or 0
        except BrokenPipeError:
            _mute()
            return 128 + signal.SIGPIPE
        except (Exception, KeyboardInterrupt) as error:
            # between Mitsuba and Python an interrupt may turn into any other exception
            if signals.received or isinstance(error, KeyboardInterrupt):
                return signals.end()
            if not isinstance(error, (ValueError, OSError, MemoryError)):
                raise
            print(f"mitsonar: {_sentence(error)}", file=sys.stderr)
            return 2


def _warn(message, *_):
    print(f"mitsonar: {message}", file=sys.stderr)


class _Signals:
    """Let Ctrl-C and a request to terminate end the command by the same way, and remember which of them came."""

    def __enter__(self):
        self.received, self.before = None, {}
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:                 # whoever started us wants it ignored
                self.before[number] = signal.signal(number, self._stop)
        return self

    def __exit__(self, *_):
        for number, handler in self.before.items():
            signal.signal(number, handler)

    def _stop(self, number, _frame):
        self.received = number
        raise KeyboardInterrupt

    def end(self):
        """Say that the command was interrupted, and end it, or give its exit code where no signal came."""
        for number in self.before:
            signal.signal(number, signal.SIG_IGN)      # a second Ctrl-C shall not break into the last words
        after_echo = "\n" if self.received == signal.SIGINT and sys.stderr.isatty() else ""     # the terminal's ^C
        print(f"{after_echo}mitsonar: interrupted; no unfinished file is left", file=sys.stderr, flush=True)
        if self.received is None:
            return 128 + signal.SIGINT
        # Python's orderly end crashes on a library whose import was interrupted
        os._exit(128 + self.received)


def _parser():
    parser = _Parser(prog="mitsonar", description="Render sonar images of Mitsuba scenes.")
    parser.add_argument("-v", "--version", action="version", version=f"mitsonar {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    render = commands.add_parser("render", help="render a scene to an EXR")
    render.add_argument("scene", help="Mitsuba XML file, or the name of a scene that comes with mitsonar")
    render.add_argument("-o", "--output", required=True, metavar="OUT.exr")
    render.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                        help="value for a $parameter of the scene; repeatable")
    render.add_argument("--seed", type=_whole, default=0, metavar="N", help="of all that is random; default: 0")
    render.add_argument("--preview", metavar="OUT.png", help="also write a picture with axes and scale")
    render.add_argument("--threads", type=_whole, metavar="N", help="worker threads, at least 2; default: one per core")
    render.set_defaults(run=_render)

    signals = commands.add_parser("signals", help="write what the elements of an array hear to a netCDF file")
    signals.add_argument("scene", help="Mitsuba XML file, or the name of a scene that comes with mitsonar")
    signals.add_argument("-o", "--output", required=True, metavar="OUT.nc")
    signals.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                         help="value for a $parameter of the scene; repeatable")
    signals.add_argument("--ping", type=_whole, action="append", metavar="N",
                         help="which ping; repeatable; default: all")
    signals.add_argument("--response", action="store_true",
                         help="the impulse response of every pair of elements instead")
    signals.add_argument("--kernel", default="band_limited", help="band_limited (default), peterson or nearest")
    signals.add_argument("--return-path", default="vector", help="vector (default), paper or eigenray")
    signals.add_argument("--path", action="append", metavar="NAME",
                         help="only echoes along this path, such as b, bs or v; may be repeated; default: all")
    signals.add_argument("--seed", type=_whole, default=0, metavar="N", help="of all that is random; default: 0")
    signals.add_argument("--threads", type=_whole, metavar="N",
                         help="worker threads, at least 2; default: one per core")
    signals.set_defaults(run=_signals)

    plot = commands.add_parser("plot", help="draw what an EXR of mitsonar holds")
    plot.add_argument("image", metavar="IN.exr")
    plot.add_argument("--what", default="waterfall", metavar="VIEW",
                      help="waterfall (default), ping, mean, labels, depth, shadow or rays")
    plot.add_argument("-o", "--output", metavar="OUT.png", help="default: the name of the EXR with the view's name")
    plot.add_argument("--ping", type=_whole, metavar="N",
                      help="which ping the view `ping` shows; default: the middle one")
    plot.add_argument("--tvg", default="seabed", choices=("seabed", "target", "none"), help="display gain over range")
    plot.set_defaults(run=_plot)

    published = commands.add_parser("published", help="compute a table or figure of the published method anew")
    published.add_argument("result", metavar="RESULT", help="table_1, effective_speed, figure_2 or figure_3")
    published.add_argument("-o", "--output", metavar="OUT.png|OUT.csv",
                           help="figure or numbers; default: say the result here")
    published.set_defaults(run=_published)

    validate = commands.add_parser("validate", help="compare with closed forms, published numbers and exact eigenrays")
    validate.add_argument("-o", "--output", metavar="FOLDER", help="write report.md and pictures there; default: none")
    validate.add_argument("--only", nargs="+", metavar="NAME", help="of the comparisons; default: all")
    validate.add_argument("--quick", action="store_true", help="fewer rays and sediments: a minute in place of several")
    validate.set_defaults(run=_validate)

    demo = commands.add_parser("demo", help="render the demo scene into demo.exr and demo.png here")
    demo.add_argument("--seed", type=_whole, default=0, metavar="N")
    demo.set_defaults(run=_demo)

    doctor = commands.add_parser("doctor", help="say what was found on this machine and render one ping")
    doctor.set_defaults(run=_doctor)
    commands.add_parser("test", help="run the project's tests (in a checkout)")
    commands.add_parser("llvm", help="say which libLLVM is used; fetch one where there is none")
    return parser


def _parameters(arguments):
    parameters = {}
    for key, value in map(_key_value, arguments.parameters):
        if key in parameters:
            raise ValueError(f"-D {key} is given twice, as {parameters[key]} and {value}; leave one out")
        parameters[key] = value
    return parameters


def _render(arguments):
    _render_to(_scene_file(arguments.scene), _parameters(arguments), arguments.seed, arguments.output,
               arguments.preview, arguments.threads)


def _signals(arguments):
    from .io import files
    from .io import signals as netcdf

    path = _scene_file(arguments.scene)
    files.check_writable(arguments.output)
    if os.path.splitext(arguments.output)[1].lower() != ".nc":
        raise ValueError(f"cannot write {arguments.output}: its name must end in .nc")
    from .elements import element_signals, impulse_response, pings
    from .scene import load_file

    _set_up(arguments.threads)
    scene = load_file(path, **_parameters(arguments))
    listen = impulse_response if arguments.response else element_signals
    with _Progress() as progress:
        heard = listen(scene, arguments.ping or range(pings(scene)), kernel=arguments.kernel,
                       return_path=arguments.return_path, seed=arguments.seed, paths=arguments.path,
                       progress=progress)
    netcdf.write(arguments.output, heard)
    _announce(arguments.output)


def _demo(arguments):
    _render_to(_scene_file("sidescan_targets"), {}, arguments.seed, "demo.exr", "demo.png", None)


def _plot(arguments):
    from . import plots
    from .io import exr

    dataset = exr.read(arguments.image)
    output = arguments.output or f"{os.path.splitext(arguments.image)[0]}_{arguments.what}.png"
    tvg = None if arguments.tvg == "none" else arguments.tvg
    plots.plot(dataset, arguments.what, output, tvg=tvg, ping=arguments.ping)
    _announce(output)


def _published(arguments):
    from . import published

    _set_up(None)
    if arguments.output is None:
        print(published.text(arguments.result), flush=True)
        return
    published.write(arguments.result, arguments.output)
    _announce(arguments.output)


def _validate(arguments):
    from .validation import validate

    _set_up(None)
    holds = validate(arguments.only, quick=arguments.quick, folder=arguments.output,
                     say=lambda text: print(text, flush=True))
    if arguments.output is not None:
        _announce(os.path.join(arguments.output, "report.md"))
    return 0 if holds else 1


def _doctor(arguments):
    from . import doctor

    def check():
        from . import load_file, render

        render(load_file(_scene_file("sidescan_flat"), pings=1, rays=2000, bins=100))

    return doctor.run(check)


def _render_to(scene_file, parameters, seed, output, preview, threads):
    _check_outputs(output, preview)
    from . import load_file, render
    from .io import exr

    _set_up(threads)
    scene = load_file(scene_file, **parameters)
    with _Progress() as progress:
        dataset = render(scene, seed=seed, progress=progress)
    exr.write(dataset, output)
    _announce(output)
    if preview is not None:
        from . import plots

        plots.preview(dataset, preview)
        _announce(preview)


def _check_outputs(output, preview):
    """An hour of rendering must not end in a missing folder."""
    from .io.files import check_writable

    try:
        f"{output}{preview}".encode()
    except UnicodeEncodeError:
        raise ValueError("cannot write a file whose name is not UTF-8; give another name") from None
    check_writable(output)
    if os.path.splitext(output)[1].lower() != ".exr":
        raise ValueError(f"cannot write {output}: its name must end in .exr; pictures are made by --preview")
    if preview is not None:
        from .plots.canvas import file_format

        file_format(preview)
        check_writable(preview)


def _set_up(threads):
    """Silence what Mitsuba says beside its errors, and set the number of threads."""
    import drjit as dr
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    if threads is None:
        return
    if not 2 <= threads <= MOST_THREADS:
        raise ValueError(f"--threads is {threads}; give 2 to {MOST_THREADS} (Mitsuba needs two even on one core)")
    try:
        dr.set_thread_count(threads)
    except RuntimeError as error:
        raise ValueError(f"--threads is {threads}, more than this machine starts: {error}; give fewer") from None


def _announce(path):
    """Print the name of a file that was written; that nobody listens does not undo it."""
    try:
        print(path, flush=True)
    except OSError:
        _mute()


def _mute():
    """Send what is left to print to nowhere, else Python complains about it when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


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
        rate = done / (now - self.start)
        pace = f"{rate:.1f} pings/s, {datetime.timedelta(seconds=round((total - done) / rate))} left"
        if not sys.stderr.isatty():
            if now - self.last_line > LINE_SECONDS:
                self.last_line = now
                print(f"{done} of {total} pings, {pace}", file=sys.stderr)
        elif self.bar is None:
            self._open(done, total, pace)
        else:
            self.bar.update(self.task, completed=done, pace=pace)

    def _open(self, done, total, pace):
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        self.bar = Progress(TextColumn("rendering"), BarColumn(), MofNCompleteColumn(),
                            TextColumn("pings, {task.fields[pace]}"), console=Console(stderr=True), transient=True)
        self.task = self.bar.add_task("pings", completed=done, total=total, pace=pace)
        self.bar.start()


def _key_value(text):
    key, equals, value = text.partition("=")
    if not (equals and key):
        raise ValueError(f"-D takes KEY=VALUE, got {text!r}; for example -D pings=200")
    return key, value


def _whole(text):
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def _scene_file(name):
    if os.path.exists(name):
        return name
    if os.path.dirname(name) == "":
        shipped = files("mitsonar.scenes") / (name if name.endswith(".xml") else f"{name}.xml")
        if shipped.is_file():
            return str(shipped)
    known = ", ".join(sorted(os.path.splitext(entry.name)[0] for entry in files("mitsonar.scenes").iterdir()
                             if entry.name.endswith(".xml")))
    raise FileNotFoundError(f"scene {name} does not exist; give the path of a Mitsuba XML file or one of: {known}")


def _sentence(error):
    if isinstance(error, MemoryError):
        return f"out of memory: {error or 'nothing more is known'}; take fewer pings, rays or bins"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return " ".join(str(error).split())

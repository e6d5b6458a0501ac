"""The commands about recorded lines: soundings, like."""
from __future__ import annotations

import contextlib
import datetime
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from mitsonar.io.scene_files import scenes

from .arguments import Commands, add_scene, check_output, number, parameters, set_up, whole
from .completion import add_file
from .progress import Progress
from .words import announce, leave_if_interrupted, warn

if TYPE_CHECKING:
    import xarray as xr

LINES = (".all", ".gsf", ".hsx", ".kmall", ".kmwcd", ".nc", ".s7k", ".wcd", ".xtf")    # recorded, not scenes


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    command = commands.add_parser("soundings", help="sound the bed of a scene with its multibeam, or convert a line of "
                                                    "soundings")
    add_scene(command, ", or a recorded line")
    add_file(command, "-o", "--output", required=True, metavar="OUT.nc|csv|gsf|kmall|las|s7k", help="soundings")
    add_file(command, "--profile", metavar="CAST",
             help="file of the cast that reduces the soundings; default: the water's own")
    command.add_argument("--tide", metavar="FILE|M",
                         help="tide that reduces soundings: a table, or a water level [m], 0 for none; default: the "
                              "water's or the line's own")
    command.add_argument("--separation", metavar="FILE|M",
                         help="height of the vertical datum above the ellipsoid: a grid, such as a geoid, or a number "
                              "[m]; default: that of the water or the line")
    command.add_argument("--heights", choices=("tide", "gnss"), default=None,
                         help="depths by draft, heave and tide, or by heights above the ellipsoid less the separation; "
                              "default: tide")
    add_file(command, "--navigation", metavar="FILE",
             help="position, attitude and ellipsoid heights for a recorded line: SBET, POS MV, CSV or XTF")
    add_file(command, "--heave", metavar="FILE", help="delayed heave for a recorded line: POS MV with groups 111")
    command.add_argument("--head-speed", type=number, metavar="M/S",
                         help="another sound speed at the head, for a recorded line")
    command.add_argument("--column", action="store_true",
                         help="keep the water column, and the snippets of a recorded line")
    command.add_argument("--snippets", type=whole, default=0, metavar="N",
                         help="samples of the bed's backscatter strength to keep about each sounding; default: 0")
    command.add_argument("--start", metavar="DATE",
                         help="date of time 0, such as 2026-05-01T10:00:00Z; default: that of the line or of a dated "
                              "track, or 2000")
    command.add_argument("--place", nargs=2, type=number, metavar=("LAT", "LON"),
                         help="position of x = y = 0 if the scene names no coordinate system; default: 0 0")
    command.add_argument("--processes", type=whole, default=1, metavar="N",
                         help="processes that share the pings of a scene, each with --threads; default: 1")
    command.add_argument("--dry-run", action="store_true",
                         help="estimate time and disk space from a few pings of a scene, and end")
    command.set_defaults(run=_soundings)

    like = commands.add_parser("like", help="make a scene like a recorded line of soundings, or of a sidescan: its "
                                            "track, sonar and bed")
    add_file(like, "line", metavar="LINE", help="line of soundings, or of a sidescan (.xtf, .jsf, .sdf)")
    add_file(like, "-o", "--output", required=True, metavar="SCENE.xml",
             help="scene; its track, cast and bed are written beside it, of a sidescan the map of its strength")
    like.add_argument("--cell", type=number, metavar="M",
                      help="cell of the bed's grid, or of the map of a sidescan; default: by the density of soundings "
                           "or samples")
    like.add_argument("--pings", type=whole, metavar="N", help="number of first pings to use; default: all")
    like.add_argument("--frequency", type=number, metavar="KHZ",
                      help="which of a sidescan's frequencies; default: the first pair of channels")
    like.set_defaults(run=_like)


def _soundings(arguments):
    from mitsonar.io import survey_lines

    check_output(arguments.output, tuple(survey_lines.SUFFIXES))
    place = None if arguments.place is None else tuple(arguments.place)
    if arguments.dry_run:
        return _estimate(arguments, place)
    before, words = 0, []
    with Progress(warm_up=1 if arguments.processes == 1 else 4 * arguments.processes) as progress:
        if _is_recorded(arguments.scene):
            written = survey_lines.write(_recorded(arguments, words), arguments.output, place=place,
                                         start=arguments.start)
        else:
            before, written = _simulated(arguments, place, progress)
    announce(arguments.output)
    kept = (f"{before} pings were already in the file",) if before else ()
    pings = "1 ping" if written.pings == 1 else f"{written.pings} pings"
    warn("; ".join((f"{written.soundings} soundings of {pings}", *written.words, *words, *kept)))


def level_of(text: str | None) -> float | str | None:
    """Return the height [m] that a text states, or the text, the name of a file."""
    if text is None:
        return None
    try:
        return float(text)
    except ValueError:
        return text


def _is_recorded(path):
    """Return True if the file is a recorded line, not a scene, by its name or its first bytes."""
    if os.path.splitext(path)[1].lower() in LINES:
        return True
    if not (os.path.isfile(path) and os.access(path, os.R_OK)):            # the reader of scenes reports the error
        return False
    from mitsonar.io.survey_lines import reading

    with open(path, "rb") as stream:
        head = stream.read(8)
    return not head.lstrip().startswith(b"<") and reading.recognised(head) is not None


def _simulated(arguments, place, progress):
    """Write soundings of a scene; return the number of pings kept from an interrupted run, and the written line."""
    from mitsonar.device import files
    from mitsonar.io.records import ping_file
    from mitsonar.verbs import sounding_files

    leave_if_interrupted(ping_file.part_of(files.check_writable(arguments.output)))
    began: list[int] = []

    def shown(done: int, count: int) -> None:
        progress(done - began[0], count - began[0])

    with _line(arguments, place) as (count, pings_from):
        def begun(number: int) -> Iterator[xr.Dataset]:
            began.append(number)
            return pings_from(number)

        return sounding_files.store(begun, count, arguments.output, place=place, start=arguments.start, progress=shown)


@contextlib.contextmanager
def _line(arguments, place):
    """Yield the number of pings of a scene's line, and a function that yields its pings from a number on."""
    if arguments.head_speed is not None:
        raise ValueError("--head-speed applies to recorded lines; in a scene write head_speed_error of the sensor.")
    for option in ("navigation", "heave"):
        if getattr(arguments, option) is not None:
            raise ValueError(f"--{option} applies to recorded lines; in a scene write the track of the sensor.")
    from mitsonar.io import survey_lines

    survey_lines.check_asked(place, arguments.start)
    options = _options(arguments)
    if arguments.processes == 1:
        count, pings_of = _sounder(arguments, options)
        yield count, lambda start: pings_of(range(start, count))
        return
    from mitsonar.sweep.manifest import versions
    from mitsonar.sweep.pools.local import Local, shares
    from mitsonar.sweep.pools.sounding_jobs import PingBlocks

    processes, threads = shares(arguments.processes, arguments.threads)
    with Local(processes, threads, os.getcwd()) as pool:
        blocks = PingBlocks(pool, {"scene": scenes.find(arguments.scene), "parameters": parameters(arguments),
                                   "seed": arguments.seed, "soundings": options, "versions": versions(),
                                   "folder": os.getcwd()})
        yield blocks.count, blocks.pings_from


def _options(arguments):
    """Return the options of `mitsonar.soundings`."""
    return {"profile": arguments.profile, "tide": level_of(arguments.tide),
            "separation": level_of(arguments.separation), "heights": arguments.heights or "tide",
            "sensor": arguments.sensor, "column": arguments.column, "snippets": arguments.snippets}


def _sounder(arguments, options):
    """Return the number of pings of a scene's line, and a function that yields pings by their numbers."""
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.verbs.images import sounder

    set_up(arguments.threads)
    return sounder(load_for_sonar(scenes.find(arguments.scene), **parameters(arguments)), arguments.seed, **options)


def _estimate(arguments, place):
    """Print what the soundings of a scene cost, from a few pings."""
    from mitsonar.device.machine import cores
    from mitsonar.sweep.pools.local import shares
    from mitsonar.verbs import sounding_files

    from .sweep import size_said

    if _is_recorded(arguments.scene):
        raise ValueError(f"--dry-run applies to scenes only, and {arguments.scene} is a recorded line; leave it out.")
    processes, _ = shares(arguments.processes, arguments.threads)
    count, pings_of = _sounder(arguments, _options(arguments))
    cost = sounding_files.cost(count, pings_of, arguments.output, place=place, start=arguments.start)
    at_once = max(1.0, min(processes, cores() / cost.cores))
    announce(f"{cost.pings} pings: about {datetime.timedelta(seconds=round(cost.seconds * count / at_once))}, "
             f"{cost.seconds:.2g} s each (tried {cost.tried}), by {processes} "
             f"process{'' if processes == 1 else 'es'} that keep {cost.cores:.1f} cores busy each")
    announce(f"disk: about {size_said(cost.bytes)}, and until it is done {size_said(cost.part)} more; "
             f"{size_said(cost.free)} are free")


def _recorded(arguments, words):
    """Yield the blocks of a recorded line, reduced again by the instrument's own rules if something is changed.

    Remarks on the line and on the rules are appended to `words`.
    """
    given = [option for option, value in (("-D", arguments.parameters), ("--seed", arguments.seed),
                                          ("--sensor", arguments.sensor), ("--snippets", arguments.snippets),
                                          ("--threads", arguments.threads is not None),
                                          ("--processes", arguments.processes != 1)) if value]
    if given:
        raise ValueError(f"{given[0]} applies to scenes only, and {arguments.scene} is a recorded line; leave it out.")
    from mitsonar.hydrography.reduction.resounding import resounded
    from mitsonar.io import casts, survey_lines
    from mitsonar.planning.instrument_rules import rules_of
    from mitsonar.planning.recorded.line_changes import changes

    if os.path.exists(arguments.output):
        for source in survey_lines.sources(arguments.scene):
            if os.path.samefile(source, arguments.output):
                raise ValueError(f"{arguments.output} is the line itself, and the output may hold less than it; "
                                 "give another name.")
    profile = None if arguments.profile is None else casts.read(arguments.profile).profile
    changed = changes(tide=level_of(arguments.tide), separation=level_of(arguments.separation), words=words,
                      heights=arguments.heights, navigation=arguments.navigation, heave=arguments.heave)
    rules = None
    for block in survey_lines.read_blocks(arguments.scene, column=arguments.column):
        remarks = filter(None, map(block.attrs.get, ("left_out", "reduction")))
        words.extend(remark for remark in remarks if remark not in words)
        if profile is None and arguments.head_speed is None and not changed:
            yield block
            continue
        if rules is None:
            rules = rules_of(block)
            words.extend(rules.words)
        block = changed.of(block)
        reduction = rules.arguments(block)
        if arguments.head_speed is not None:
            reduction |= {"head_speed": arguments.head_speed, "node": True}
        yield resounded(block, profile, **reduction)


def _like(arguments):
    from mitsonar.device.files import check_readable
    from mitsonar.io import sidescan_lines
    from mitsonar.planning.like_line import like
    from mitsonar.planning.twins.like_sidescan import like_sidescan

    if arguments.cell is not None and not 0 < arguments.cell < 1e4:
        raise ValueError(f"--cell is {arguments.cell:g} m; give a number above 0, up to 10 000.")
    if arguments.pings is not None and arguments.pings < 2:
        raise ValueError(f"--pings is {arguments.pings}; a track takes two or more.")
    check_readable(arguments.line, "the line", "a recorded line")
    pings = None if arguments.pings is None else slice(0, arguments.pings)
    if sidescan_lines.recognised(arguments.line):
        frequency = None if arguments.frequency is None else 1e3 * arguments.frequency
        written = like_sidescan(arguments.line, arguments.output, cell=arguments.cell, say=warn, pings=pings,
                                frequency=frequency)
    elif arguments.frequency is not None:
        raise ValueError(f"--frequency is {arguments.frequency:g}, and {arguments.line} is a line of soundings; leave "
                         "it out.")
    else:
        written = like(arguments.line, arguments.output, cell=arguments.cell, say=warn, pings=pings)
    for path in written:
        announce(path)

"""The commands about lines of soundings: soundings, like."""
from __future__ import annotations

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
                         help="tide that reduces soundings of a scene: a CSV file, or a water level [m], 0 for none; "
                              "default: the water's own")
    command.add_argument("--head-speed", type=number, metavar="M/S",
                         help="another sound speed at the head, for a recorded line")
    command.add_argument("--column", action="store_true", help="keep the water column")
    command.add_argument("--snippets", type=whole, default=0, metavar="N",
                         help="samples of the bed's backscatter strength to keep about each sounding; default: 0")
    command.add_argument("--start", metavar="DATE",
                         help="date of time 0, such as 2026-05-01T10:00:00Z; default: that of the line or of a dated "
                              "track, or 2000")
    command.add_argument("--place", nargs=2, type=number, metavar=("LAT", "LON"),
                         help="position of x = y = 0 if the scene names no coordinate system; default: 0 0")
    command.set_defaults(run=_soundings)

    like = commands.add_parser("like", help="make a scene like a recorded line: its track, cast, sounder and bed")
    add_file(like, "line", metavar="LINE.all|kmall|gsf|s7k|xtf|hsx", help="line of soundings")
    add_file(like, "-o", "--output", required=True, metavar="SCENE.xml",
             help="scene; its track, cast and bed are written beside it")
    like.add_argument("--cell", type=number, metavar="M",
                      help="cell of the bed's grid; default: by the density of soundings")
    like.add_argument("--pings", type=whole, metavar="N", help="number of first pings to use; default: all")
    like.set_defaults(run=_like)


def _soundings(arguments):
    from mitsonar.io import survey_lines

    check_output(arguments.output, tuple(survey_lines.SUFFIXES))
    place = None if arguments.place is None else tuple(arguments.place)
    before, words = 0, []
    with Progress() as progress:
        if _is_recorded(arguments.scene):
            written = survey_lines.write(_recorded(arguments, words), arguments.output, place=place,
                                         start=arguments.start)
        else:
            before, written = _simulated(arguments, place, progress)
    announce(arguments.output)
    kept = (f"{before} pings were already in the file",) if before else ()
    warn("; ".join((f"{written.soundings} soundings of {written.pings} pings", *written.words, *words, *kept)))


def tide_of(text: str) -> float | str:
    """Return the water level [m] that a text states, or the text, the name of a file."""
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
    """Write soundings of a scene; return the number of pings kept from an interrupted run, and the written line.

    Pings go into a file beside the output, from which an interrupted command continues. The output is written last.
    """
    if arguments.head_speed is not None:
        raise ValueError("--head-speed applies to recorded lines; in a scene write head_speed_error of the sensor.")
    from mitsonar.device import files
    from mitsonar.io import survey_lines
    from mitsonar.io.records import ping_file
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.images import sounded_pings

    part = ping_file.part_of(files.check_writable(arguments.output))
    survey_lines.check_asked(place, arguments.start)
    set_up(arguments.threads)
    total: list[int] = []
    scene = load_file(scenes.find(arguments.scene), **parameters(arguments))

    def pings_from(number: int) -> Iterator[xr.Dataset]:
        began.append(number)
        return sounded_pings(scene, arguments.seed, arguments.profile, tide=tide, sensor=arguments.sensor,
                             column=arguments.column, snippets=arguments.snippets, start=number, count=total.append)

    tide = None if arguments.tide is None else tide_of(arguments.tide)
    began: list[int] = []
    pings = pings_from(0)
    leave_if_interrupted(part)
    ping_file.fill(lambda number: pings if number == 0 else pings_from(number), part, count=total[0],
                   check=lambda first: survey_lines.check_asked(place, arguments.start, first),
                   progress=lambda done, count: progress(done - began[-1], count - began[-1]))
    files.clear_left(arguments.output)
    written = survey_lines.write(survey_lines.stored(part), arguments.output, place=place, start=arguments.start)
    part.unlink()
    return began[-1], written


def _recorded(arguments, words):
    """Yield the blocks of a recorded line, reduced again by the instrument's own rules if a cast or speed is given.

    Remarks on the line and on the rules are appended to `words`.
    """
    given = [option for option, value in (("-D", arguments.parameters), ("--seed", arguments.seed),
                                          ("--sensor", arguments.sensor), ("--snippets", arguments.snippets),
                                          ("--threads", arguments.threads is not None),
                                          ("--tide", arguments.tide)) if value]
    if given:
        raise ValueError(f"{given[0]} applies to scenes only, and {arguments.scene} is a recorded line; leave it out.")
    from mitsonar.hydrography.reduction.resounding import resounded
    from mitsonar.io import casts, survey_lines
    from mitsonar.planning.instrument_rules import rules_of

    if os.path.exists(arguments.output):
        for source in survey_lines.sources(arguments.scene):
            if os.path.samefile(source, arguments.output):
                raise ValueError(f"{arguments.output} is the line itself, and the output may hold less than it; "
                                 "give another name.")
    profile = None if arguments.profile is None else casts.read(arguments.profile).profile
    rules = None
    for block in survey_lines.read_blocks(arguments.scene, column=arguments.column):
        remarks = filter(None, map(block.attrs.get, ("left_out", "reduction")))
        words.extend(remark for remark in remarks if remark not in words)
        if profile is None and arguments.head_speed is None:
            yield block
            continue
        if rules is None:
            rules = rules_of(block)
            words.extend(rules.words)
        reduction = rules.arguments(block)
        if arguments.head_speed is not None:
            reduction |= {"head_speed": arguments.head_speed, "node": True}
        yield resounded(block, profile, **reduction)


def _like(arguments):
    from mitsonar.planning.like_line import like

    if arguments.cell is not None and not 0 < arguments.cell < 1e4:
        raise ValueError(f"--cell is {arguments.cell:g} m; give a number above 0, up to 10 000.")
    if arguments.pings is not None and arguments.pings < 2:
        raise ValueError(f"--pings is {arguments.pings}; a track takes two or more.")
    for path in like(arguments.line, arguments.output, cell=arguments.cell, say=warn,
                     pings=None if arguments.pings is None else slice(0, arguments.pings)):
        announce(path)

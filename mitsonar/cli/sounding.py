"""The command soundings: those of a scene, or of a line that was recorded, as a file that survey software opens."""
import os

from mitsonar.io.scene_files import scenes

from .arguments import Commands, add_scene, number, parameters, set_up, whole
from .completion import FILES, complete_with
from .progress import Progress
from .words import InterruptSignals, announce, warn

LINES = (".all", ".gsf", ".kmall", ".kmwcd", ".nc", ".wcd")        # that are read in place of a scene


def add(commands: Commands) -> None:
    """Add the command to the parser's."""
    command = commands.add_parser("soundings", help="sound the bed of a scene with its multibeam, or convert a line of "
                                                    "soundings")
    add_scene(command)
    output = command.add_argument("-o", "--output", required=True, metavar="OUT.nc|csv|gsf|kmall|las")
    complete_with(output, FILES)
    complete_with(command.add_argument("--profile", metavar="CAST",
                                       help="file of the cast that soundings are made with; default: the water's own"),
                  FILES)
    command.add_argument("--head-speed", type=number, metavar="M/S",
                         help="of a line that was recorded: another sound speed at the head")
    command.add_argument("--column", action="store_true", help="keep the water column")
    command.add_argument("--snippets", type=whole, default=0, metavar="N",
                         help="keep so many samples of the bed's strength about each sounding")
    command.add_argument("--start", metavar="DATE",
                         help="of time 0, such as 2026-05-01T10:00:00Z; default: as the line or a dated track "
                              "says, or 2000")
    command.add_argument("--place", nargs=2, type=number, metavar=("LAT", "LON"),
                         help="of x = y = 0 where the scene names no coordinate system; default: 0 0")
    command.add_argument("--sensor", default=0, metavar="ID", help="which of the scene's sonars; default: the first")
    command.set_defaults(run=_soundings)


def _soundings(arguments):
    from mitsonar.io import survey_lines

    suffix = os.path.splitext(arguments.output)[1].lower()
    if suffix not in survey_lines.SUFFIXES:
        raise ValueError(f"cannot write {arguments.output}: its name says no kind of file; let it end in one of "
                         f"{', '.join(survey_lines.SUFFIXES)}.")
    place = None if arguments.place is None else tuple(arguments.place)
    before = 0
    with Progress() as progress:
        words: list[str] = []
        if _is_recorded(arguments.scene):
            written = survey_lines.write(_recorded(arguments, words), arguments.output, place=place,
                                         start=arguments.start)
        else:
            before, written = _simulated(arguments, place, progress)
    announce(arguments.output)
    kept = (f"{before} pings were there from before",) if before else ()
    warn("; ".join((f"{written.soundings} soundings of {written.pings} pings", *written.words, *words, *kept)))


def _is_recorded(path):
    """Return whether a line stands in a scene's place: by its name, or by how it begins."""
    if os.path.splitext(path)[1].lower() in LINES:
        return True
    if not (os.path.isfile(path) and os.access(path, os.R_OK)):            # whoever reads a scene says so
        return False
    from mitsonar.io.survey_lines import reading

    with open(path, "rb") as stream:
        head = stream.read(8)
    return not head.lstrip().startswith(b"<") and reading.recognised(head) is not None


def _simulated(arguments, place, progress):
    """Write soundings of a scene; give the number of an interrupted command's pings, and what was written.

    Pings go into a file beside the output, which the same command goes on with; at the end the output is made of it.
    """
    if arguments.head_speed is not None:
        raise ValueError("--head-speed is of a line that was recorded; a scene says head_speed_error in its sensor.")
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

    def pings_from(number):
        began.append(number)
        return sounded_pings(scene, arguments.seed, arguments.profile, sensor=arguments.sensor, column=arguments.column,
                             snippets=arguments.snippets, start=number, count=total.append)

    began: list[int] = []
    made = pings_from(0)
    if InterruptSignals.active is not None:
        InterruptSignals.active.left = part
    ping_file.fill(lambda number: made if number == 0 else pings_from(number), part, count=total[0],
                   check=lambda first: survey_lines.check_asked(place, arguments.start, first),
                   progress=lambda done, all_of_them: progress(done - began[-1], all_of_them - began[-1]))
    files.clear_left(arguments.output)
    written = survey_lines.write(survey_lines.stored(part), arguments.output, place=place, start=arguments.start)
    part.unlink()
    return began[-1], written


def _recorded(arguments, words):
    """A line of a file, reduced anew where that is asked for, by the instrument's own rules, which go into `words`."""
    given = [option for option, there in (("-D", arguments.parameters), ("--seed", arguments.seed),
                                          ("--sensor", arguments.sensor), ("--snippets", arguments.snippets),
                                          ("--threads", arguments.threads is not None)) if there]
    if given:
        raise ValueError(f"{given[0]} is of scenes, and {arguments.scene} is a line that was recorded; leave it out.")
    from mitsonar.hydrography.reduction.resounding import resounded
    from mitsonar.io import casts, survey_lines
    from mitsonar.planning.instrument_rules import rules_of

    if os.path.exists(arguments.output):
        for source in survey_lines.sources(arguments.scene):
            if os.path.samefile(source, arguments.output):
                raise ValueError(f"{arguments.output} is the line itself, and what is written may hold less than it; "
                                 "give another name.")
    profile = None if arguments.profile is None else casts.read(arguments.profile).profile
    rules = None
    for block in survey_lines.read_blocks(arguments.scene, column=arguments.column):
        if (left := block.attrs.get("left_out")) and left not in words:
            words.append(left)
        if profile is None and arguments.head_speed is None:
            yield block
            continue
        if rules is None:
            rules = rules_of(block)
            words.extend(rules.words)
        about = rules.arguments(block)
        if arguments.head_speed is not None:
            about |= {"head_speed": arguments.head_speed, "node": True}
        yield resounded(block, profile, **about)


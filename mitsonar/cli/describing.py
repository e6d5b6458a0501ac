"""The commands that describe scenes, plugins and presets: scenes, describe, show."""
import shutil
import textwrap
from pathlib import Path

from mitsonar.verbs import guide

from .arguments import Commands, add_parameters, check_picture, parameters, set_up, whole
from .completion import add_file
from .words import announce, warn

NARROWEST, WIDEST = 40, 110        # columns; within these as wide as the terminal


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    listed = commands.add_parser("scenes", help="list the scenes that come with mitsonar, or copy a scene with all its "
                                                "files into a folder")
    add_file(listed, "scene", nargs="?", shipped=True, help="scene to copy; default: list those of mitsonar")
    listed.add_argument("-o", "--output", metavar="FOLDER", help="new or empty folder of the copy")
    listed.add_argument("--outside", action="store_true",
                        help="copy files outside the scene's folder too; a scene may name any file that you can read")
    listed.set_defaults(run=_scenes)
    describe = commands.add_parser("describe", help="list the parameters of a scene, the attributes of a plugin, or "
                                                    "the figures of a preset with their sources")
    add_file(describe, "name", metavar="SCENE|PLUGIN|PRESET", nargs="?", shipped=True,
             help="name or file of a scene, or name of a plugin, such as sidescan, or of a preset, such as "
                  "oculus_m750d; instruments lists the presets of instruments")
    describe.add_argument("--markdown", action="store_true",
                          help="print the reference page of all plugins, or with the name instruments their page")
    describe.set_defaults(run=_describe)

    show = commands.add_parser("show", help="draw plan and section of a scene, and what its sonar sees, without "
                                            "rendering it")
    add_file(show, "scene", shipped=True, help="Mitsuba XML file, or the name of a scene that comes with mitsonar")
    add_file(show, "-o", "--output", metavar="OUT.png", help="picture; default: SCENE_plan.png here")
    add_parameters(show)
    show.add_argument("--sensor", default=0, metavar="ID",
                      help="id of one of the scene's sonars; default: the first")
    show.add_argument("--ping", type=whole, metavar="N",
                      help="number of the ping of the section, from 0; default: the middle one")
    show.set_defaults(run=_show)


def _scenes(arguments):
    if arguments.scene is None:
        if arguments.output is not None or arguments.outside:
            raise ValueError("scenes -o copies a scene; give the scene too.")
        return announce(guide.scenes())
    if arguments.output is None:
        raise ValueError(f"scenes {arguments.scene} copies this scene; give a folder by -o, or see "
                         f"mitsonar describe {arguments.scene}.")
    from mitsonar.io.scene_files.portable import copy_scene
    from mitsonar.plugins import reference

    names = copy_scene(arguments.scene, arguments.output, reference.input_files, outside=arguments.outside)
    announce(Path(arguments.output) / names[0])
    warn(f"{len(names)} files are in {arguments.output}")


def _describe(arguments):
    if arguments.markdown:
        from mitsonar.plugins import instruments, page

        if arguments.name not in (None, instruments.LIST):
            raise ValueError(f"describe --markdown takes no name but {instruments.LIST}; leave {arguments.name} or "
                             "--markdown out")
        return announce((instruments if arguments.name else page).markdown().rstrip("\n"))
    if arguments.name is None:
        raise ValueError("describe takes the name of a scene, a plugin or a preset, or --markdown; give one of them")
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    for number, (heading, text) in enumerate(guide.describe(arguments.name).paragraphs()):
        if number:
            announce("")
        announce(heading)
        for paragraph in text.split("\n"):
            for line in textwrap.wrap(paragraph, width, initial_indent="    ", subsequent_indent="    "):
                announce(line)


def _show(arguments):
    from mitsonar.io.scene_files import scenes

    path = scenes.find(arguments.scene)
    output = arguments.output or f"{Path(path).stem}_plan.png"
    check_picture(output)
    from mitsonar.plots.sheets.scene_sheet import show
    from mitsonar.scene.loading import load_for_sonar

    set_up(None)
    show(load_for_sonar(path, **parameters(arguments)), output, sensor=arguments.sensor, ping=arguments.ping)
    announce(output)

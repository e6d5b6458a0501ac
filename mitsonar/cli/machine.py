"""The commands about this machine: doctor, test, llvm."""
from mitsonar.io.scene_files import scenes

from .arguments import Commands


def add(commands: Commands) -> None:
    """Add the commands to the parser's; ``test`` and ``llvm`` run before this package is imported."""
    commands.add_parser("doctor", help="show versions and backends of this machine, and render one ping"
                        ).set_defaults(run=_doctor)
    commands.add_parser("test", help="run the project's tests (in a checkout)")
    commands.add_parser("llvm", help="print the path of the libLLVM in use; download one if there is none")


def _doctor(arguments):
    from .setup import doctor

    def check() -> None:
        from mitsonar import load_file, render

        render(load_file(scenes.find("sidescan_flat"), pings=1, rays=2000, bins=100))

    return doctor.run(check)

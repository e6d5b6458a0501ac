"""What was found on this machine, by the name that it had before it stood in `mitsonar.cli.setup.doctor`."""
from mitsonar.cli.setup.doctor import BACKENDS, PACKAGES, report, run

__all__ = ["BACKENDS", "PACKAGES", "report", "run"]

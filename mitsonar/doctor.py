"""What was found on this machine, by the name that it had before it stood in `mitsonar.cli.doctor`."""
from mitsonar.cli.doctor import BACKENDS, PACKAGES, report, run

__all__ = ["BACKENDS", "PACKAGES", "report", "run"]

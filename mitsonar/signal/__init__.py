"""From hits to echoes."""
from .echoes import EchoSums, echo_energy

__all__ = ["EchoSums", "echo_energy"]

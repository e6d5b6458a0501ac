"""Hits and echoes as functions of parameters, attached to the derivatives of Dr.Jit."""

"""Sidescan sonar: its run over a scene, its coherent echoes and its picture."""

"""What every picture has, whatever its sonar: the same truth and coordinates, with units and meanings; and true depths.

The scene is a level bed, 12 m below the surface, with a box on it; small and coarse, since only names and places count.
"""
import functools

import mitsuba as mi
import numpy as np
import pytest
import sonar_scenes as scenes

import mitsonar
import mitsonar.scene.loading
from mitsonar.survey.kinds import KINDS
from mitsonar.validation.scenes import bed, lambert

DEPTH, HEAD = 12.0, 4.0
COMMON = {"level": "dB re 1 µPa", "label": "1", "class": "1", "share": "1", "hidden": "1", "object_shadow": "1",
          "layover": "1", "seabed_x": "m", "seabed_y": "m", "seabed_depth": "m", "depth": "m", "shadow": "1", "rays": "1"}
COORDINATES = {"ping": "1", "ping_time": "s", "x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad",
               "heading": "rad", "altitude": "m", "range": "m", "time": "s"}
ATTRIBUTES = {"sonar", "seed", "sound_speed", "frequency", "source_level_db", "bin_width", "labels", "classes", "objects"}
MEASURED = {"level", "mean_level", "phase", "coherence", "angle", "valid", "uncertainty", "error"}
SHORT = {"range": 24.0}

"""The sound speed of a summer's day in a shallow sea, with its thermocline: table, profile, and text of a scene."""
from mitsonar.water import SoundSpeedProfile

SUMMER_TABLE = ([0, 4, 8, 11, 14, 17, 20, 25, 32, 40],                                                    # depth [m]
                [1513.2, 1513.0, 1511.6, 1506.4, 1500.8, 1496.6, 1494.2, 1492.9, 1492.3, 1492.2])         # [m/s]
SUMMER = SoundSpeedProfile(*SUMMER_TABLE)
SUMMER_TEXT = ", ".join(f"{depth:g}:{speed:g}" for depth, speed in zip(*SUMMER_TABLE))

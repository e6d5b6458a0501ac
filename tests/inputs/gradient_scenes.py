"""Small scenes that gradients are tried on."""
from __future__ import annotations

from scene_text import lambert, plugin, scene_text

WATERS = {"uniform": '<float name="sound_speed" value="1500"/>',
          "thermocline": '<string name="profile" value="0:1492, 18:1490, 24:1478, 30:1474, 50:1474"/>'}
WAVES = ('<float name="sine_wavelength" value="16"/> <float name="sine_height" value="0.4"/> '
         '<float name="sine_heading_deg" value="70"/>')


def sidescan(water: str = "uniform", *, rays: int = 20_000, pings: int = 4, more: str = "", sonar: str = "",
             integrator: str = "", waves: str = WAVES) -> str:
    """A scene file: a sidescan 12 m above a wavy bed, all lit."""
    return scene_text(
        plugin("shape", "seabed", "bed", waves, lambert(-25), depth=30.0, length=24.0, width=70.0, spacing=1.0), more,
        plugin("sensor", "sidescan", "sonar", sonar, plugin("medium", "seawater", "water", WATERS[water]),
               plugin("film", "sonar_film", range=34.0, bins=100), pings=pings, start=(0, -4, -18), speed_knots=3.0),
        rays=rays, integrator=integrator)


def forward_looking(water: str = "uniform") -> str:
    """A scene file: a forward-looking sonar 6 m above a wavy bed."""
    return scene_text(
        plugin("shape", "seabed", "bed", lambert(-25), depth=12.0, length=60.0, width=60.0, spacing=0.5,
               sine_wavelength=8.0, sine_height=0.2),
        plugin("sensor", "forward_looking", "sonar", plugin("medium", "seawater", "", WATERS[water]),
               plugin("film", "sonar_film", range=25.0, bins=400), pings=2, start=(0, -20, -6), speed_knots=2.0,
               frequency_khz=200.0, pulse="cw", pulse_ms=0.1, beams=16))

"""Protocol of the integrator that renders sound; see `plugins.integrators.sonar_path`."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from .sensor import RunSettings, Sensor

if TYPE_CHECKING:                   # what renders is imported where it is asked for
    import mitsuba as mi
    import xarray as xr

    from .pressure.array_survey import ArraySurvey
    from .survey import Survey


@runtime_checkable
class SoundIntegrator(Protocol):
    """Integrator that plans runs of sonars and renders them."""

    settings: RunSettings

    def survey(self, scene: mi.Scene, sensor: Sensor, seed: int = 0) -> Survey:
        """Plan a run of a sonar over a scene, whose scatterers are drawn by the seed."""
        ...

    def array_survey(self, scene: mi.Scene, sensor: Sensor, lead: float = 0.0, seed: int = 0) -> ArraySurvey:
        """Plan the same run for the signals of the sonar's elements; the record begins `lead` pulses early."""
        ...

    def picture(self, survey: Survey, sensor: Sensor, seed: int = 0,
                progress: Callable[[float, float], None] | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
        """Render a planned run; see `mitsonar.render`."""
        ...

    def frame(self, survey: Survey, sensor: Sensor, seed: int = 0) -> Callable[[int], xr.Dataset]:
        """Return the function that renders the picture of one ping; see `mitsonar.frames` and `mitsonar.Sonar`."""
        ...


def integrator_of(scene: mi.Scene) -> SoundIntegrator:
    """Return the scene's integrator, which must render sound."""
    integrator = scene.integrator()
    if not isinstance(integrator, SoundIntegrator):
        raise ValueError("the scene's integrator cannot render sound; write <integrator type=\"sonar_path\"/>")
    return integrator

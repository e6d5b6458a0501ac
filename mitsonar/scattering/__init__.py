"""What the seabed and other surfaces are made of: relief, roughness and the laws of scattering."""
from . import lambert
from .fractal import Fractal
from .relief import Plane, Relief, Sinusoid, Sum
from .ripples import Ripples
from .roughness import RoughnessSpectrum

# Laws of scattering by the name of their material; each module holds `scattering_strength`.
LAWS = {"lambert": lambert}

__all__ = ["LAWS", "Fractal", "Plane", "Relief", "Ripples", "RoughnessSpectrum", "Sinusoid", "Sum"]

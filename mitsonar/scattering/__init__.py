"""What the seabed and other surfaces are made of: relief, roughness and the laws of scattering."""
from .fractal import Fractal
from .relief import Plane, Relief, Sinusoid, Sum
from .ripples import Ripples
from .roughness import RoughnessSpectrum

__all__ = ["Fractal", "Plane", "Relief", "Ripples", "RoughnessSpectrum", "Sinusoid", "Sum"]

"""Images of finished sweeps, or of any image files of mitsonar, as NumPy, xarray and PyTorch data.

    images = mitsonar.dataset.open("sweep")      len(images), images[3], images.parameters["range"], images.stack()
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)

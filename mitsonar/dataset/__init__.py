"""A finished sweep, or any files of images of mitsonar, as data: NumPy, xarray, PyTorch.

    images = mitsonar.dataset.open("sweep")      len(images), images[3], images.parameters["range"], images.stack()
"""
from .images import Images, open

__all__ = ["Images", "open"]

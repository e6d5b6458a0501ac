"""The verbs of the package: images and signals, strips of a synthetic aperture, gradients."""

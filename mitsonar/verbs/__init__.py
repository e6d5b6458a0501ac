"""Top-level functions of the package: images and signals, synthetic aperture strips, gradients."""

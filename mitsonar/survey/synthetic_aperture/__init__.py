"""Strips of a synthetic aperture: plan, raw echoes ping by ping, focused image, and truth of the image."""

"""A strip of a synthetic aperture: its plan, its raw echoes ping by ping, its focused image and that image's truth."""

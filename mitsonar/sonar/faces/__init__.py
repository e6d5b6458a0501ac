"""Faces of transducers: shapes of beams, directivity, the near field."""

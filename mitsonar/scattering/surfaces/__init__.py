"""Building blocks of scattering laws: reflection, roughness, facets."""

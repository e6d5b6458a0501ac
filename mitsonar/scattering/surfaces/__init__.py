"""Parts that scattering laws are made of: reflection, roughness, facets."""

"""Find the first hits of rays: in trees of triangles, in several scenes together, and on grids without a tree."""

"""Parameters of a scene that gradients are taken of."""

"""The check of gradients against differences of rendered records."""

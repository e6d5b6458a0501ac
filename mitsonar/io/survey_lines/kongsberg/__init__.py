"""Lines of soundings in Kongsberg's file formats."""

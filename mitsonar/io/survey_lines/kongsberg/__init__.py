"""Lines of soundings in the files of Kongsberg."""

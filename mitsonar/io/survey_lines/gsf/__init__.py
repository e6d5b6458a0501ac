"""Lines of soundings in Generic Sensor Format."""

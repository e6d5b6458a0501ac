"""Detection of the bed in the beams of a ping, and its strength."""

"""Motion of a sonar: tracks, trajectories, rotating heads."""

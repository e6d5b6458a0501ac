"""Motion of what carries a sonar: tracks, trajectories, rotating heads."""

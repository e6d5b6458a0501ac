"""Plan surveys, and make scenes and lines like a survey that was run."""

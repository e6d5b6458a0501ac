"""Products of focused images: heights, coherence, change, statistics."""

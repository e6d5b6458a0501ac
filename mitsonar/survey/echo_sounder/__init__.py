"""Plan and simulate an echo sounder."""

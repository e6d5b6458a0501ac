"""What comes back: one kind of echo a file, and the sonar equation."""

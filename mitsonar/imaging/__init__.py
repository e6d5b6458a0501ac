"""From echoes to images, one kind of sonar a file."""

"""A rotating head: the echoes that each of its pings hears, and its pings as rows of an energy record."""

"""The beam domain: an array's picture from echoes laid on a grid of time and sine, without signals of elements."""

"""Values of a render's parameters: computed, chosen by cases, and drawn together."""

"""Read HSX files of HYPACK."""

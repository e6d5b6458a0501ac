"""Read s7k files of Teledyne Reson, Norbit and others."""

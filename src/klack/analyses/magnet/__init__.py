"""``klack magnet``."""

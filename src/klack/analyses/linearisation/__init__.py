"""``klack linearise``."""

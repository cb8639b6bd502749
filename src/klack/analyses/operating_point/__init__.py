"""``klack stroke --steady``."""

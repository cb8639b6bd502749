"""Expensive results, cached on disk under a key of all that they depend on."""

"""Expensive results, cached on disk under a key of everything that they depend on."""

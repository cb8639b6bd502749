"""Meshes of bodies: families, named surfaces, profiles, sweeping, CAD."""

"""Meshes, modes and steps that a wanted accuracy needs."""

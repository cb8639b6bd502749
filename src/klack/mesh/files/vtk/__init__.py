"""Grids of VTK."""

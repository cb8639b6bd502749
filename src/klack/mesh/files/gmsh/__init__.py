"""Meshes of Gmsh."""

"""Mesh, modes and step for a target, each from a measured convergence."""

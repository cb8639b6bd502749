"""Sensors on a body: rows on its nodal displacements, and records over time."""

"""What a sensor on a body reads: rows on its nodal displacements, and the record over time."""

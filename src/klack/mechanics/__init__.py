"""Mechanical components: bodies, springs, forces, friction, end stops; one per file."""

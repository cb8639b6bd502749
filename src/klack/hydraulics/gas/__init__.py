"""Gases and pneumatic components: chambers, orifices, seats, sources; one per file."""

"""Bodies reduced to modes and static corrections."""

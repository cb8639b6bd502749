"""Magnetic circuits, coils and their drivers; one component per file."""

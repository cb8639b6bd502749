"""Fluids and hydraulic components: restrictions, chambers, lines, films; one per file."""

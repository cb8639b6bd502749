"""Whole files and folders, held and locked, and the caller's own."""

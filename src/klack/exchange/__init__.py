"""Exports to other programs, and their results read back."""

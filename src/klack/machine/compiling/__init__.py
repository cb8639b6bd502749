"""Compiled functions: marks, and storage of machine code."""

"""Compiled functions: how they are marked, and where their machine code is kept."""

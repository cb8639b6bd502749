"""Measured strokes: records, single strokes, and their measures."""

"""Measured strokes: records, single strokes, and the numbers that are read off them."""

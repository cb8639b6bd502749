"""``klack heat``: how a valve warms up stroke by stroke, and what that does to its strokes."""

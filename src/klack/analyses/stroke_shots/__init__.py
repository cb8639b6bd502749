"""``klack shots`` of a whole valve: many strokes in three dimensions."""

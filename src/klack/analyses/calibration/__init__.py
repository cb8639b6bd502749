"""Parameters of a valve fitted to measured strokes."""

"""Time integration of reduced bodies: exact propagator, discrete-gradient contact."""

"""Results of a study for other programs."""

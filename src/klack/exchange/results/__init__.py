"""Results of a study for other programs: time histories, numbers and fields."""

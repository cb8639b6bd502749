"""A study: the measures of a case at many points of its parameter space."""

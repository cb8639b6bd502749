"""From a case to bodies, contact problems and networks."""

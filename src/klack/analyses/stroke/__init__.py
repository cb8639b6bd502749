"""One actuation of a whole valve."""

"""Components, their ports, and the rows of the solver; no physics."""

"""Components, the ports that they meet in, and the rows that the solver runs; no physics."""

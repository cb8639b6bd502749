"""Controllers: sensors with their errors, and laws from signals to one output; no physics."""

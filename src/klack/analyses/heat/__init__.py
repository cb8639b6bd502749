"""``klack heat``: warm-up of a valve stroke by stroke, and its effects."""

"""Many drops of one valve, each a little different."""

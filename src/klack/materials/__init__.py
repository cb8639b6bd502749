"""Materials: elastic, yielding, and libraries of numbers with their sources."""

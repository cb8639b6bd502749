"""Mathematics of studies: designs of points, sensitivity, search for optima, probabilities."""

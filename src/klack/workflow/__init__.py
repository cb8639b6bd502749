"""From a case to its results: the steps in order, with progress."""

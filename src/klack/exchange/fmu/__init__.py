"""Models as Functional Mock-up Units."""

"""Models as Functional Mock-up Units: C sources, binaries, model description, documentation."""

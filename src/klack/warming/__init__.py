"""Compile ahead what a command will need."""

"""Finished meshes from files of other programs, one folder per format."""

"""Finished meshes from files of other programs, one folder for each format."""

"""Matrices and reduced models in the files of other programs."""

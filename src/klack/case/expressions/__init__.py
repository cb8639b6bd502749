"""Arithmetic of quantities as text, with dimensions; nothing is ever run."""

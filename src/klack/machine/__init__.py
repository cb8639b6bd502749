"""Needs of long work: cores, memory, stored results, compiled code, progress."""

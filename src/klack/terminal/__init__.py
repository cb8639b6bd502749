"""Shared by commands: options, progress, tables and files."""

"""Receivers of structure-borne sound: plates, modes, and measured responses with their files."""

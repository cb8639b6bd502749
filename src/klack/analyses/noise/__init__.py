"""Sound of an impact or a stroke."""

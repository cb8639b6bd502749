"""User input: sections of documented keys, and one clear error for each mistake."""

"""One dry impact, at one or several levels."""

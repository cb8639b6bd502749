"""Case files: one YAML document that describes bodies, contact and what to run."""

"""What is heard of an impact or a stroke."""

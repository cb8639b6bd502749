"""What long work asks of the machine: cores, memory, stored results, compiled code, progress."""

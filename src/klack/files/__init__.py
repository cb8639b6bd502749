"""Files and folders that are whole or not there, held and locked, and the caller's own."""

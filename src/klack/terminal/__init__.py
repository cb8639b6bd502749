"""What commands share: options, progress, tables and files on the terminal."""

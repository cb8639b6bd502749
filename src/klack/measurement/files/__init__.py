"""One reader per file format, each a :class:`klack.measurement.recording.Recording`."""

"""One reader per file format; all of them are a :class:`klack.measurement.recording.Recording`."""

"""The session folder: writer, files, manifest, reader, recovery and export."""

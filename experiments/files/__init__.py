"""Arrays, maps and fields in files."""

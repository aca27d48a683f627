"""Maps, curves, certificates and devices in files; pages, and arrays that are cached."""

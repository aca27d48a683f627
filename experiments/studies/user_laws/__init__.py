"""People against the published laws of human movement, on a device that gives no force."""

"""``hvf lift``: haptic maps lifted from clips, and measures of their quality."""

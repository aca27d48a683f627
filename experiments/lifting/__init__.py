"""``hvf lift``, and how good a map of clips is."""

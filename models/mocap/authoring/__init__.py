"""The embedded clips: key poses, gaits and flights from which they are made."""

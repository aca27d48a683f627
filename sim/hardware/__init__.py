"""A real device in the loop: servo process, safety gate, recorder process, digital twin, and identification."""

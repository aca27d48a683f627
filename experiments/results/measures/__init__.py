"""Measures of a run from its recording, and the summary that is made of them."""

"""Certificates of the sampled-data loop about one curve: stability, passivity, energy."""

"""Certificates of the sampled loop about one curve: stability, passivity, energy."""

"""Retargeting: from a foreign skeleton to the figure."""

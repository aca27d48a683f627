"""From a foreign skeleton to the figure."""

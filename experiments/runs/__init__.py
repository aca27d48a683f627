"""Runs into folders and in memory: from a configuration or from Python, reproduced, completed, swept, tracked."""

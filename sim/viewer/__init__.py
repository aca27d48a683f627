"""Visualisation in the browser: the live page and the replay."""

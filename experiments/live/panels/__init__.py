"""Panels of the live page."""

"""Certificates of fields, runs and clips, kept in folders."""

"""Dynamics of clips: contacts, contact forces, momentum, and trajectory optimisation."""

"""Preparation of captures: from a retargeted clip to one that is closed or at rest at its ends, and feasible."""

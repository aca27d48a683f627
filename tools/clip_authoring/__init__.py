"""Authoring of the embedded clips from key poses, footsteps and gait curves."""

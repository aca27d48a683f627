"""Motion capture: clips, readers, writer, retargeting, preparation, dynamics."""

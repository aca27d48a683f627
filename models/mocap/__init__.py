"""Motion capture: clips, readers, writer, retargeting, authoring."""

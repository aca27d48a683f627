"""Mathematics: curves, fields, haptic maps, certificates. No simulator, no device, no clock, no files."""

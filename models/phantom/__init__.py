"""The PHANToM Premium 1.5: MuJoCo linkage and closed form."""

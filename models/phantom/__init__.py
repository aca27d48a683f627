"""The PHANToM Premium 1.5: MuJoCo model of the linkage, and closed-form kinematics and dynamics."""

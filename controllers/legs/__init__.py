"""Legs: inverse kinematics of limbs, stance and swing, foot placement, and removal of foot skate."""

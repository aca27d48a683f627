"""The servo, run block by block."""

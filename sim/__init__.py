"""The loop: world, servo, devices, users, recorder, viewer."""

"""The walker that is led: its path over the floor, its gait."""

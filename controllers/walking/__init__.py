"""The walker that follows the stylus: its path over the floor, its gait, its state."""

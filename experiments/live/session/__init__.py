"""A live session without its page: the engine in a process of its own, its messages, gains, takes, and the desk."""

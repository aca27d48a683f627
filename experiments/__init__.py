"""What people run: the ``hvf`` command. The only place where concrete parts are wired together."""

"""The ``hvf`` command and what it runs. The only package in which concrete parts are put together."""

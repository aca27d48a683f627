"""The ``hvf`` command and what it runs. The only package in which concrete parts are put together."""

from experiments.console import rendering_backend as rendering_backend  # before any import of MuJoCo

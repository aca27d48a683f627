"""The ``hvf`` command and what it runs. The only package in which concrete parts are put together."""

import experiments.console.rendering_backend  # noqa: F401  # before any import of MuJoCo

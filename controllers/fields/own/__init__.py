"""User-defined laws: a function, interpreted or compiled, as a force law."""
